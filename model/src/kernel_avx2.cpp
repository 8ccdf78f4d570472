// Inner loops for machines with AVX2 and FMA; compiled with those flags, see model/CMakeLists.txt.
#define TROCHOID_ISA isa_avx2
#include "top_kernel_run.hpp"
