// A configuration of plain joints, for the devices of several tests.
#pragma once

#include <cstring>

#include "config.h"

namespace rig {

// q1 and q2 do 4000 steps/s within +-100,000 steps; `max_acceleration` in steps/s2.
inline gemelo::DeviceConfig plain_joints(const char* name, int32_t max_acceleration) {
    gemelo::DeviceConfig config{};
    std::strncpy(config.name, name, sizeof config.name - 1);
    config.tick_hz = 50000;
    config.queue_capacity = 128;
    config.state_hz = 50;
    config.sensor_hz = 10;
    config.is_armed_at_boot = 1;
    config.hold_timeout_ms = 500;
    config.joints = 2;
    for (uint8_t j = 0; j < config.joints; ++j) {
        gemelo::JointConfig& joint = config.joint[j];
        std::strncpy(joint.name, j == 0 ? "q1" : "q2", sizeof joint.name - 1);
        joint.lower_q8 = -100000 * 256;
        joint.upper_q8 = 100000 * 256;
        joint.max_velocity_q8 = 4000 * 256;
        joint.max_acceleration_q8 = max_acceleration * 256;
        joint.dir_setup_us = 5;
    }
    return config;
}

}  // namespace rig
