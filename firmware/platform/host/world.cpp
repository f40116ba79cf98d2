#include "world.h"

#include <math.h>

namespace gemelo {
namespace {

constexpr int32_t kEchoUs = 1166;     // of something at 20 cm, the sound at 343 m/s
constexpr int32_t kBatteryMv = 2467;  // a third of 7.4 V

}  // namespace

void World::wire(const DeviceConfig& config, const Pins& pins) {
    config_ = config;
    pins_ = pins;
    const double tick_s = config.tick_hz == 0 ? 1.0 : 1.0 / config.tick_hz;
    for (uint8_t j = 0; j < kMaxJoints; ++j) {
        motor_[j].begin(motor_config_[j], tick_s, shaft_[j]);
        motor_[j].hold(is_blocked_[j] || !is_enabled_);
    }
    for (uint8_t i = 0; i < config.sensors; ++i)
        raw_[i] = config.sensor[i].kind == SensorKind::Ultrasonic ? kEchoUs : kBatteryMv;
    read_horn();
    for (uint8_t i = 0; i < config.inputs; ++i) switch_[i] = switch_of(config, i);
    levels_ = Levels{};
    read_switches();
}

World::Switch World::switch_of(const DeviceConfig& config, uint8_t input) {
    const InputConfig& wired = config.input[input];
    if (wired.joint >= config.joints) return Switch{0, 0, 0};
    const JointConfig& joint = config.joint[wired.joint];
    const HomingConfig& homing = joint.homing;
    if (homing.input == input)
        return Switch{wired.joint, homing.direction, static_cast<int64_t>(homing.position_q8) * homing.direction};
    // Beside the joint's way, where a person would put it: a fiftieth of the travel beyond the soft limit.
    const int64_t lower = joint.lower_q8, upper = joint.upper_q8, margin = (upper - lower) / 50;
    if (wired.role == InputRole::LimitLower) return Switch{wired.joint, -1, margin - lower};
    if (wired.role == InputRole::LimitUpper) return Switch{wired.joint, 1, upper + margin};
    return Switch{0, 0, 0};
}

void World::tick(const Pins& pins) {
    if (unread_ != 0) --unread_;
    const uint32_t rising = pins.step & ~pins_.step;
    pins_ = pins;
    for (uint8_t j = 0; j < config_.joints; ++j) {
        const uint32_t bit = 1u << j;
        if ((rising & bit) != 0) {
            const bool is_positive = ((pins.dir & bit) != 0) != (config_.joint[j].is_inverted != 0);
            motor_[j].pulse(is_positive ? 1 : -1);
        } else if (motor_[j].is_settled()) {
            continue;
        }
        motor_[j].tick();
        follow(j);
    }
}

void World::follow(uint8_t joint) {
    const int32_t shaft = motor_[joint].shaft();
    if (shaft == shaft_[joint]) return;
    shaft_[joint] = shaft;
    read_switches();
}

void World::enable(bool is_enabled) {
    if (is_enabled == is_enabled_) return;
    is_enabled_ = is_enabled;
    for (uint8_t j = 0; j < kMaxJoints; ++j) {
        motor_[j].hold(is_blocked_[j] || !is_enabled);
        follow(j);
    }
}

void World::turn_horn(uint32_t pulse_us) {
    const double before_us = horn_.place_us();
    horn_.advance(pulse_us, 1.0 / kSlotHz);
    if (horn_.place_us() != before_us) read_horn();
}

void World::read_horn() {
    if (horn_.is_there() && horn_.sensor() < config_.sensors) set_sensor(horn_.sensor(), horn_.value());
}

void World::inherit(const World& before) {
    horn_ = before.horn_;
    for (uint8_t i = 0; i < kMaxInputs; ++i) press_[i] = before.press_[i];
    for (uint8_t i = 0; i < config_.sensors && i < before.config_.sensors; ++i) raw_[i] = before.raw_[i];
    for (uint8_t j = 0; j < kMaxJoints; ++j) block(j, before.is_blocked_[j]);
    read_switches();
}

void World::press(uint8_t input, Press press) {
    press_[input] = press;
    read_switches();
}

void World::block(uint8_t joint, bool is_blocked) {
    is_blocked_[joint] = is_blocked;
    motor_[joint].hold(is_blocked || !is_enabled_);
    follow(joint);
}

void World::slip(uint8_t joint, int32_t pulses) {
    motor_[joint].slip(pulses);
    follow(joint);
}

void World::set_sensor(uint8_t sensor, double value) {
    const SensorConfig& wired = config_.sensor[sensor];
    if (wired.scale_q16 == 0) return;
    const double raw = (value * 1000 - wired.offset_milli) * 65536 / wired.scale_q16;
    raw_[sensor] = static_cast<int32_t>(lround(fmin(fmax(raw, INT32_MIN), INT32_MAX)));
}

bool World::are_motors_settled() const {
    for (uint8_t j = 0; j < config_.joints; ++j)
        if (!motor_[j].is_settled()) return false;
    return true;
}

bool World::is_active(uint8_t input) const {
    if (press_[input] != Press::Left) return press_[input] == Press::Held;
    const Switch& found = switch_[input];
    return found.sign != 0 && found.sign * (static_cast<int64_t>(shaft_[found.joint]) * 256) >= found.threshold_q8;
}

void World::read_switches() {
    Levels levels;
    for (uint8_t i = 0; i < config_.inputs; ++i) {
        const InputConfig& wired = config_.input[i];
        if (is_active(i) == (wired.is_inverted != 0)) continue;
        (wired.pin < 32 ? levels.low : levels.high) |= 1u << (wired.pin % 32);
    }
    if (levels.low == levels_.low && levels.high == levels_.high) return;
    levels_ = levels;
    unread_ = kReadings;
}

}  // namespace gemelo
