// For machines with AVX2; compiled for these, see tracking/CMakeLists.txt.
#define TROCHOID_STRETCH_ISA isa_avx2
#include "edges/stretch_kernel_run.hpp"
