// The same C functions for every program, over its class template Simulation<Real>.
#pragma once
#include "problem.h"

#define WITH_PRECISION(NAME, REAL)                                                              \
    extern "C" void* create_##NAME(const Problem* problem) {                                    \
        return new Simulation<REAL>(*problem);                                                  \
    }                                                                                           \
    extern "C" void run_##NAME(void* simulation, int64_t steps) {                               \
        static_cast<Simulation<REAL>*>(simulation)->run(steps);                                 \
    }                                                                                           \
    extern "C" void positions_##NAME(const void* simulation, double* out) {                     \
        static_cast<const Simulation<REAL>*>(simulation)->positions(out);                       \
    }                                                                                           \
    extern "C" void destroy_##NAME(void* simulation) {                                          \
        delete static_cast<Simulation<REAL>*>(simulation);                                      \
    }

WITH_PRECISION(float32, float)
WITH_PRECISION(float64, double)
