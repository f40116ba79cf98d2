#include "bench.h"

#include <algorithm>
#include <cstring>

using namespace gemelo;

namespace property {
namespace {

constexpr Driver kDrivers[] = {
    {"A4988", 1000, 1000, 200},
    {"DM542T", 2500, 2500, 5000},
    {"opto-isolated", 8000, 8000, 60000},
};

constexpr uint32_t kTickHz[] = {50000, 80000, 100000, 50000, 20000};

// From a tenth of a second to a few seconds to full speed; not quite one pulse in two ticks, at which a knot's rounding
// may ask for more.
JointConfig random_joint(Dice& dice, const Driver& driver, uint32_t tick_hz) {
    JointConfig joint{};
    const double fastest = std::min(dice.logarithmic(200, 60000), tick_hz * 63.0 / 128);
    const double harshest = std::clamp(fastest / dice.logarithmic(0.1, 3.0), 1000.0, 200000.0);
    joint.max_velocity_q8 = static_cast<int32_t>(fastest * 256);
    joint.max_acceleration_q8 = static_cast<int32_t>(harshest * 256);
    const double room = fastest * dice.logarithmic(1.0, 30.0) + fastest * fastest / harshest;
    joint.upper_q8 = static_cast<int32_t>(std::min(room, 4.0e6) * 256);
    joint.lower_q8 = -static_cast<int32_t>(std::min(room * dice.logarithmic(0.3, 1.0), 4.0e6) * 256);
    joint.dir_setup_us = (driver.dir_setup_ns + 999) / 1000;
    joint.is_inverted = dice.chance(0.5);
    return joint;
}

InputConfig input(InputRole role, uint8_t pin, uint8_t joint, bool is_inverted) {
    InputConfig input{};
    input.name[0] = 'i';
    input.name[1] = static_cast<char>('a' + pin);
    input.pin = pin;
    input.role = role;
    input.joint = joint;
    input.is_inverted = is_inverted;
    return input;
}

// An e-stop, a switch at one joint's end, and one that every other joint homes to.
void wire(DeviceConfig& config, Dice& dice) {
    uint8_t pin = 0;
    const auto add = [&](InputRole role, uint8_t joint) {
        config.input[config.inputs++] = input(role, pin, joint, dice.chance(0.5));
        pin = static_cast<uint8_t>(pin + dice.between(1, 4));
    };
    add(InputRole::EStop, kNone);
    add(InputRole::LimitUpper, static_cast<uint8_t>(dice.between(0, config.joints - 1)));
    for (uint8_t j = 0; j < config.joints; ++j) {
        JointConfig& joint = config.joint[j];
        joint.homing = HomingConfig{};
        const int64_t travel_q8 = static_cast<int64_t>(joint.upper_q8) - joint.lower_q8;
        joint.homing.fast_q8 = velocity_limit_q8(config, j) / 2;
        if (j % 2 != 0 || travel_q8 > 8ll * joint.homing.fast_q8) continue;
        joint.homing.input = config.inputs;
        joint.homing.direction = -1;
        joint.homing.slow_q8 = std::min(joint.homing.fast_q8, static_cast<int32_t>(config.tick_hz / 16) * 256);
        joint.homing.back_off_q8 = 50 * 256;
        joint.homing.position_q8 = joint.lower_q8 / 256 * 256;
        joint.homing.max_travel_q8 = static_cast<int32_t>(std::min<int64_t>(2 * travel_q8, INT32_MAX));
        joint.homing.timeout_ms = 120000;
        joint.homing.group = static_cast<uint8_t>(dice.between(0, 1));
        add(InputRole::Home, j);
    }
}

}  // namespace

Bench random_bench(Dice& dice) {
    Bench bench{};
    DeviceConfig& config = bench.config;
    std::strcpy(config.name, "bench");
    config.tick_hz = kTickHz[dice.between(0, 4)];
    config.queue_capacity = dice.chance(0.7) ? 128 : static_cast<uint32_t>(dice.between(32, 127));
    config.state_hz = 50;
    config.sensor_hz = 10;
    config.hold_timeout_ms = 500;
    config.is_armed_at_boot = 1;
    config.joints = static_cast<uint8_t>(dice.between(1, kMaxJoints));
    for (uint8_t j = 0; j < config.joints; ++j) {
        bench.drivers.push_back(kDrivers[dice.between(0, 2)]);
        config.joint[j] = random_joint(dice, bench.drivers.back(), config.tick_hz);
        config.joint[j].name[0] = 'q';
        config.joint[j].name[1] = static_cast<char>('1' + j);
    }
    wire(config, dice);
    return bench;
}

}  // namespace property
