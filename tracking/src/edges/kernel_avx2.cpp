// For machines with AVX2 and FMA; compiled with those flags, see tracking/CMakeLists.txt.
#define TROCHOID_STRETCH_ISA isa_avx2
#include "edges/stretch_kernel_run.hpp"
