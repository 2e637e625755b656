// What every C++ program is given: the population as plain arrays of double, robot after robot.
#pragma once
#include <cstdint>

struct Problem {
    int64_t robots, masses, springs;     // masses and springs of one robot
    const int32_t* ends;                 // (springs, 2) the topology that all robots share
    const double* mass;                  // (robots, masses) kg
    const double* positions;             // (robots, masses, 3) m
    const double* velocities;            // (robots, masses, 3) m/s
    const double* stiffness;             // (robots, springs) N/m
    const double* rest;                  // (robots, springs) m
    const double* amplitude;             // (robots, springs) m
    const double* phase;                 // (robots, springs) rad
    const double* omega;                 // (robots) rad/s
    double gravity[3];                   // m/s^2
    double dt, keep;                     // s; part of the velocity that a step leaves
    double ground;                       // stiffness of the ground N/m, 0 for none
    double static_friction, kinetic_friction;
    int64_t threads;
};
