#pragma once

/// Which instruction set the including file is compiled for. The numerical headers (dual.hpp,
/// dormand_prince.hpp, taylor.hpp, the equations) put everything into the inline namespace
/// TROCHOID_ISA, so that a file compiled for wide vectors never shares a function with the rest of
/// the program: whichever copy the linker kept would run on machines that lack the instructions.
/// For the same reason these headers use no Eigen, no standard container and no non-builtin inline
/// function. Only model/src/kernel_*.cpp define another name; everybody else need not know.
#ifndef TROCHOID_ISA
#define TROCHOID_ISA isa_baseline
#endif
/// How many numbers a register holds (dual.hpp): of that instruction set, not of the machine's that
/// an includer is compiled for, or the same type would have two layouts.
#ifndef TROCHOID_REGISTER_LANES
#define TROCHOID_REGISTER_LANES 4
#endif

#define TROCHOID_INLINE __attribute__((always_inline)) inline
#define TROCHOID_LAMBDA_INLINE __attribute__((always_inline))
