// For every machine.
#define TROCHOID_STRETCH_ISA isa_baseline
#include "edges/stretch_kernel_run.hpp"
