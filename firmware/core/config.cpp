#include "config.h"

#include <string.h>

namespace gemelo {
namespace {

constexpr uint8_t kMaxGroup = 15;          // chosen
constexpr uint32_t kMaxHomingMs = 600000;  // chosen: ten minutes

bool is_same(const char* a, const char* b) {
    while (*a == *b && *a != 0) ++a, ++b;
    return *a == *b;
}

// One of the first `index` parts has the name of the part at `index`.
template <typename Part>
bool is_taken(const Part* parts, uint8_t index) {
    for (uint8_t i = 0; i < index; ++i)
        if (is_same(parts[i].name, parts[index].name)) return true;
    return false;
}

template <typename Part>
const char* find_name_fault(const Part* parts, uint8_t index) {
    if (!is_name(parts[index].name)) return "its name is not 1 to 31 letters, digits, '_' or '-'";
    return is_taken(parts, index) ? "its name is there twice" : nullptr;
}

// One signal a pin.
class PinBoard {
  public:
    const char* claim(uint8_t pin) {
        if (pin > kMaxPin) return "its pin is not 0 to 63";
        const uint64_t bit = 1ull << pin;
        if ((claimed_ & bit) != 0) return "its pin is used by something else too";
        claimed_ |= bit;
        return nullptr;
    }
    const char* claim_any(uint8_t pin) { return pin == kNone ? nullptr : claim(pin); }

  private:
    uint64_t claimed_ = 0;
};

const char* find_switch_fault(const DeviceConfig& config, uint8_t j, const HomingConfig& homing) {
    if (homing.input >= config.inputs) return "its homing names an input that is not there";
    const InputConfig& input = config.input[homing.input];
    if (input.joint != j || input.role == InputRole::EStop) return "its homing names a switch that is not its own";
    if (homing.direction != 1 && homing.direction != -1) return "its homing's direction is not 1 or -1";
    const bool is_at_other_end = (input.role == InputRole::LimitLower && homing.direction > 0) ||
                                 (input.role == InputRole::LimitUpper && homing.direction < 0);
    return is_at_other_end ? "its homing leads away from its limit switch" : nullptr;
}

const char* find_homing_fault(const DeviceConfig& config, uint8_t j) {
    const JointConfig& joint = config.joint[j];
    const HomingConfig& homing = joint.homing;
    if (homing.input == kNone) return nullptr;
    const char* fault = find_switch_fault(config, j, homing);
    if (fault != nullptr) return fault;
    if (homing.group > kMaxGroup) return "its homing's group is not 0 to 15";
    if (homing.slow_q8 <= 0 || homing.slow_q8 > homing.fast_q8)
        return "its homing is not slow and then fast: 0 < slow_q8 <= fast_q8";
    if (homing.fast_q8 > velocity_limit_q8(config, j)) return "its homing is faster than its velocity limit";
    if (homing.back_off_q8 <= 0) return "its homing's back_off_q8 is not positive";
    if (homing.max_travel_q8 <= 0) return "its homing's max_travel_q8 is not positive";
    if (homing.timeout_ms < 1 || homing.timeout_ms > kMaxHomingMs) return "its homing's timeout_ms is not 1 to 600000";
    const int64_t stand_q8 = static_cast<int64_t>(homing.position_q8) - homing.direction * int64_t{homing.back_off_q8};
    if (stand_q8 < joint.lower_q8 || stand_q8 > joint.upper_q8)
        return "its homing ends, after backing off, beyond its limits";
    return nullptr;
}

const char* find_joint_fault(const DeviceConfig& config, uint8_t j, PinBoard* pins) {
    const JointConfig& joint = config.joint[j];
    const char* fault = find_name_fault(config.joint, j);
    if (fault != nullptr) return fault;
    if (joint.lower_q8 >= joint.upper_q8) return "its lower limit is not below its upper limit";
    if (joint.max_velocity_q8 <= 0) return "its velocity limit is not positive";
    if (joint.max_acceleration_q8 <= 0) return "its acceleration limit is not positive";
    if (joint.dir_setup_us > 200) return "its DIR set-up time is longer than 200 us";
    if ((joint.step_pin == kNone) != (joint.dir_pin == kNone)) return "it has only one of step_pin and dir_pin";
    if (joint.text_scale_q32 > INT64_MAX) return "its text_scale_q32 is over 2^63 - 1";
    fault = pins->claim_any(joint.step_pin);
    if (fault == nullptr) fault = pins->claim_any(joint.dir_pin);
    return fault != nullptr ? fault : find_homing_fault(config, j);
}

const char* find_input_fault(const DeviceConfig& config, uint8_t i, PinBoard* pins) {
    const InputConfig& input = config.input[i];
    const char* fault = find_name_fault(config.input, i);
    if (fault != nullptr) return fault;
    if (input.role != InputRole::EStop)
        return input.joint < config.joints ? pins->claim(input.pin) : "its joint is not there";
    if (input.joint != kNone) return "an e-stop belongs to all joints, not to one";
    for (uint8_t other = 0; other < i; ++other)
        if (config.input[other].role == InputRole::EStop) return "it is a second e-stop: wire the buttons in series";
    return pins->claim(input.pin);
}

const char* find_output_fault(const DeviceConfig& config, uint8_t i, PinBoard* pins) {
    const char* fault = find_name_fault(config.output, i);
    return fault != nullptr ? fault : pins->claim(config.output[i].pin);
}

const char* find_sensor_fault(const DeviceConfig& config, uint8_t i, PinBoard* pins) {
    const SensorConfig& sensor = config.sensor[i];
    const char* fault = find_name_fault(config.sensor, i);
    if (fault == nullptr) fault = pins->claim(sensor.pin);
    if (fault != nullptr) return fault;
    if (is_same(sensor.name, "t_us") || is_same(sensor.name, "boot_id"))
        return "its name is taken by the readings' own message";
    if (sensor.kind == SensorKind::Ultrasonic)
        return sensor.trigger_pin == kNone ? "an ultrasonic sensor needs a trigger_pin"
                                           : pins->claim(sensor.trigger_pin);
    return sensor.trigger_pin == kNone ? nullptr : "an analog sensor has no trigger_pin";
}

const char* find_servo_fault(const ServoConfig& servo, PinBoard* pins) {
    if (!is_name(servo.name)) return "its name is not 1 to 31 letters, digits, '_' or '-'";
    if (servo.lower_us < kLeastServoUs || servo.upper_us > kMostServoUs) return "its pulses are not 500 to 2500 us";
    if (servo.lower_us >= servo.upper_us) return "its lower_us is not below its upper_us";
    if (servo.speed_us_s < 10 || servo.speed_us_s > 1000000) return "its speed_us_s is not 10 to 1000000";
    return pins->claim(servo.pin);
}

bool divides_1000(uint32_t hz) { return hz >= 1 && hz <= kSlotHz && kSlotHz % hz == 0; }

const char* find_device_fault(const DeviceConfig& config, PinBoard* pins) {
    if (!is_name(config.name)) return "its name is not 1 to 31 letters, digits, '_' or '-'";
    if (config.tick_hz < 10 * kSlotHz || config.tick_hz > kMaxTickHz || config.tick_hz % kSlotHz != 0)
        return "tick_hz is not a multiple of 1000 between 10000 and 100000";
    if (config.queue_capacity < 2 || config.queue_capacity > kMaxKnots) return "queue_capacity is not 2 to 128 knots";
    if (!divides_1000(config.state_hz)) return "state_hz does not divide 1000";
    if (!divides_1000(config.sensor_hz)) return "sensor_hz does not divide 1000";
    if (config.hold_timeout_ms < 1 || config.hold_timeout_ms > 60000) return "hold_timeout_ms is not 1 to 60000";
    if (config.enable_lead_ms > 10000) return "enable_lead_ms is over 10000";
    if (config.joints < 1 || config.joints > kMaxJoints) return "there are not 1 to 8 joints";
    if (config.inputs > kMaxInputs) return "there are more than 16 inputs";
    if (config.outputs > kMaxOutputs) return "there are more than 8 outputs";
    if (config.sensors > kMaxSensors) return "there are more than 8 sensors";
    return pins->claim_any(config.enable_pin) == nullptr ? nullptr : "enable_pin is not 0 to 63";
}

}  // namespace

bool is_name(const char* name) {
    const void* end = memchr(name, 0, kNameSize);
    if (end == nullptr || end == name) return false;
    for (; *name != 0; ++name) {
        const char c = *name;
        const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        if (!plain && c != '_' && c != '-') return false;
    }
    return true;
}

ConfigFault find_fault(const DeviceConfig& config) {
    PinBoard pins;
    const char* fault = find_device_fault(config, &pins);
    if (fault != nullptr) return {fault};
    for (uint8_t j = 0; j < config.joints; ++j) {
        fault = find_joint_fault(config, j, &pins);
        if (fault != nullptr) return {fault, config.joint[j].name};
    }
    for (uint8_t i = 0; i < config.inputs; ++i) {
        fault = find_input_fault(config, i, &pins);
        if (fault != nullptr) return {fault, config.input[i].name};
    }
    for (uint8_t i = 0; i < config.outputs; ++i) {
        fault = find_output_fault(config, i, &pins);
        if (fault != nullptr) return {fault, config.output[i].name};
    }
    for (uint8_t i = 0; i < config.sensors; ++i) {
        fault = find_sensor_fault(config, i, &pins);
        if (fault != nullptr) return {fault, config.sensor[i].name};
    }
    fault = config.servo.pin == kNone ? nullptr : find_servo_fault(config.servo, &pins);
    if (fault != nullptr) return {fault, config.servo.name};
    return {};
}

int32_t velocity_limit_q8(const DeviceConfig& config, uint8_t joint) {
    const int32_t fastest_q8 = static_cast<int32_t>(config.tick_hz / 2) * 256;
    const int32_t limit_q8 = config.joint[joint].max_velocity_q8;
    return limit_q8 < fastest_q8 ? limit_q8 : fastest_q8;
}

}  // namespace gemelo
