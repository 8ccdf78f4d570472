// Inner loops for every x86-64 machine; see isa.hpp.
#include "top_kernel_run.hpp"
