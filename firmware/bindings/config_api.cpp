// A parsed configuration as JSON, field by field: so Python can check that both parsers agree.
#include <string.h>

#include <string>

#include "../core/config_text.h"

using namespace gemelo;

namespace {

constexpr const char* kRoles[] = {"estop", "limit_lower", "limit_upper", "home"};
constexpr const char* kPulls[] = {"none", "up", "down"};
constexpr const char* kSensorKinds[] = {"analog", "ultrasonic"};

// Members of one object; names need no escaping.
class Members {
  public:
    Members& text(const char* key, const std::string& value) { return raw(key, '"' + value + '"'); }
    Members& truth(const char* key, bool value) { return raw(key, value ? "true" : "false"); }
    template <typename Number>
    Members& number(const char* key, Number value) {
        return raw(key, std::to_string(value));
    }
    Members& raw(const char* key, const std::string& value) {
        text_ += (text_.empty() ? "\"" : ",\"") + std::string(key) + "\":" + value;
        return *this;
    }
    std::string object() const { return '{' + text_ + '}'; }

  private:
    std::string text_;
};

std::string say(const HomingConfig& homing) {
    if (homing.input == kNone) return "null";
    return Members()
        .number("input", homing.input)
        .number("group", homing.group)
        .number("direction", homing.direction)
        .number("fast_q8", homing.fast_q8)
        .number("slow_q8", homing.slow_q8)
        .number("back_off_q8", homing.back_off_q8)
        .number("position_q8", homing.position_q8)
        .number("max_travel_q8", homing.max_travel_q8)
        .number("timeout_ms", homing.timeout_ms)
        .object();
}

std::string say(const JointConfig& joint) {
    return Members()
        .text("name", joint.name)
        .number("lower_q8", joint.lower_q8)
        .number("upper_q8", joint.upper_q8)
        .number("max_velocity_q8", joint.max_velocity_q8)
        .number("max_acceleration_q8", joint.max_acceleration_q8)
        .truth("inverted", joint.is_inverted)
        .number("dir_setup_us", joint.dir_setup_us)
        .number("step_pin", joint.step_pin)
        .number("dir_pin", joint.dir_pin)
        .number("text_scale_q32", joint.text_scale_q32)
        .raw("homing", say(joint.homing))
        .object();
}

std::string say(const InputConfig& input) {
    return Members()
        .text("name", input.name)
        .number("pin", input.pin)
        .text("role", kRoles[static_cast<int>(input.role)])
        .number("joint", input.joint)
        .truth("inverted", input.is_inverted)
        .text("pull", kPulls[static_cast<int>(input.pull)])
        .object();
}

std::string say(const OutputConfig& output) {
    return Members()
        .text("name", output.name)
        .number("pin", output.pin)
        .truth("inverted", output.is_inverted)
        .truth("at_boot", output.at_boot)
        .truth("off_at_estop", output.is_off_at_estop)
        .object();
}

std::string say(const SensorConfig& sensor) {
    return Members()
        .text("name", sensor.name)
        .text("kind", kSensorKinds[static_cast<int>(sensor.kind)])
        .number("pin", sensor.pin)
        .number("trigger_pin", sensor.trigger_pin)
        .number("scale_q16", sensor.scale_q16)
        .number("offset_milli", sensor.offset_milli)
        .object();
}

std::string say(const ServoConfig& servo) {
    return Members()
        .text("name", servo.name)
        .number("pin", servo.pin)
        .number("lower_us", servo.lower_us)
        .number("upper_us", servo.upper_us)
        .number("speed_us_s", servo.speed_us_s)
        .truth("off_at_estop", servo.is_off_at_estop)
        .object();
}

template <typename Part>
std::string say(const Part* parts, uint8_t count) {
    std::string text = "[";
    for (uint8_t i = 0; i < count; ++i) text += (i == 0 ? "" : ",") + say(parts[i]);
    return text + ']';
}

std::string say(const DeviceConfig& config) {
    Members members;
    members.text("name", config.name)
        .raw("joints", say(config.joint, config.joints))
        .number("tick_hz", config.tick_hz)
        .number("queue_capacity", config.queue_capacity)
        .number("state_hz", config.state_hz)
        .number("sensor_hz", config.sensor_hz)
        .number("hold_timeout_ms", config.hold_timeout_ms)
        .number("enable_lead_ms", config.enable_lead_ms)
        .truth("armed_at_boot", config.is_armed_at_boot)
        .number("enable_pin", config.enable_pin)
        .truth("enable_inverted", config.is_enable_inverted)
        .raw("inputs", say(config.input, config.inputs))
        .raw("outputs", say(config.output, config.outputs))
        .raw("sensors", say(config.sensor, config.sensors));
    if (config.servo.pin != kNone) members.raw("servo", say(config.servo));
    return members.object();
}

}  // namespace

// The text that the core has read, into `out`; its size, or -1 and why it was refused, or -2 for too little room.
extern "C" int64_t gemelo_read_config(const char* text, size_t size, char* part, char* reason, char* out,
                                      size_t capacity) {
    DeviceConfig config;
    Refusal refusal;
    const bool is_taken = parse_config(text, size, &config, &refusal);
    memcpy(part, refusal.part, sizeof refusal.part);
    memcpy(reason, refusal.reason, sizeof refusal.reason);
    if (!is_taken) return -1;
    const std::string said = say(config);
    if (said.size() > capacity) return -2;
    memcpy(out, said.data(), said.size());
    return static_cast<int64_t>(said.size());
}
