// Inner loops for every x86-64 machine; see isa.hpp.
#include "top_dispatch.hpp"
#include "top_kernel_run.hpp"

namespace trochoid::model {

void run_top_dop853(const TopRun& run, TopResult& result) {
  top_kernel::run_with<DormandPrince, double, double>(run, result);
}

}  // namespace trochoid::model
