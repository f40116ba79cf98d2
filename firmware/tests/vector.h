// One shared test vector: a frame, and what a fresh device says to it.
#pragma once

#include <stdint.h>

#include <vector>

#include "config.h"

struct Vector {
    const char* name;
    std::vector<uint8_t> frame;
    bool retained;
    const char* answer;  // nullptr: none
    int code, joint, knot, value, limit;
};
