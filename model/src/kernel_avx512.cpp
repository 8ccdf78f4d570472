// Inner loops for machines with AVX-512; compiled with those flags, see model/CMakeLists.txt.
#define TROCHOID_ISA isa_avx512
#define TROCHOID_REGISTER_LANES 8
#include "top_kernel_run.hpp"
