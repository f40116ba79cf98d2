// A random device: up to eight joints, each with a driver from its data sheet.
#pragma once

#include <vector>

#include "config.h"
#include "dice.h"

namespace property {

// What a driver's data sheet asks of its inputs, in ns.
struct Driver {
    const char* name;
    uint32_t step_high_ns, step_low_ns, dir_setup_ns;
};

struct Bench {
    gemelo::DeviceConfig config;
    std::vector<Driver> drivers;  // of each joint
};

Bench random_bench(Dice& dice);

}  // namespace property
