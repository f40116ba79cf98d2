// What a device is told before it starts: its clock rates and, per joint, its limits and its driver's demands.
#pragma once

#include <stdint.h>

// A board with less memory is built for fewer.
#ifndef GEMELO_MAX_JOINTS
#define GEMELO_MAX_JOINTS 8
#endif

namespace gemelo {

constexpr uint8_t kMaxJoints = GEMELO_MAX_JOINTS;
constexpr uint16_t kMaxKnots = 128;
constexpr uint32_t kSlotUs = 1000;
constexpr uint32_t kSlotHz = 1000;
constexpr uint32_t kMaxTickHz = 100000;
constexpr uint8_t kNameSize = 32;

// Positions are absolute motor steps in Q24.8, velocities Q24.8 steps/s, accelerations Q24.8 steps/s^2.
struct JointConfig {
    char name[kNameSize];
    int32_t lower_q8;
    int32_t upper_q8;
    int32_t max_velocity_q8;
    int32_t max_acceleration_q8;
    uint32_t dir_setup_us;  // DIR stands still for so long before STEP rises
    uint32_t inverted;      // 1: DIR is high for negative travel
};

struct DeviceConfig {
    char name[kNameSize];
    uint32_t tick_hz;         // a multiple of 1000
    uint32_t queue_capacity;  // knots
    uint32_t state_hz;        // a divisor of 1000
    uint32_t hold_timeout_ms;
    uint32_t joints;
    JointConfig joint[kMaxJoints];
};

// A sentence saying what is wrong, or nullptr; `joint` is set to the joint at fault, or kMaxJoints.
const char* find_fault(const DeviceConfig& config, uint8_t* joint);

inline uint32_t ticks_per_slot(const DeviceConfig& config) { return config.tick_hz / kSlotHz; }

// The fastest this joint may turn: its own limit, or one pulse in two ticks.
int32_t velocity_limit_q8(const DeviceConfig& config, uint8_t joint);

}  // namespace gemelo
