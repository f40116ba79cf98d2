#include "config_text.h"

#include "crc32.h"
#include "phrase.h"
#include "record_reader.h"

namespace gemelo {
namespace {

constexpr bool kRequired = true;
constexpr bool kOptional = false;

constexpr const char* kRoles[] = {"estop", "limit_lower", "limit_upper", "home", nullptr};
constexpr const char* kPulls[] = {"none", "up", "down", nullptr};
constexpr const char* kSensorKinds[] = {"analog", "ultrasonic", nullptr};

constexpr Field number(const char* key, Kind kind, bool is_required, size_t offset) {
    return Field{key, kind, is_required, static_cast<uint16_t>(offset)};
}

constexpr Field name(size_t offset) {
    return Field{"name", Kind::Text, kRequired, static_cast<uint16_t>(offset), kNameSize};
}

constexpr Field word(const char* key, bool is_required, size_t offset, const char* const* words) {
    return Field{key, Kind::Word, is_required, static_cast<uint16_t>(offset), 0, words};
}

template <size_t kCount>
constexpr Record record_of(const Field (&fields)[kCount]) {
    static_assert(kCount <= 32, "a record has too many fields");
    return Record{fields, kCount};
}

constexpr Field kHomingFields[] = {
    number("input", Kind::Index, kRequired, offsetof(HomingConfig, input)),
    number("group", Kind::U8, kOptional, offsetof(HomingConfig, group)),
    number("direction", Kind::I8, kRequired, offsetof(HomingConfig, direction)),
    number("fast_q8", Kind::I32, kRequired, offsetof(HomingConfig, fast_q8)),
    number("slow_q8", Kind::I32, kRequired, offsetof(HomingConfig, slow_q8)),
    number("back_off_q8", Kind::I32, kRequired, offsetof(HomingConfig, back_off_q8)),
    number("position_q8", Kind::I32, kRequired, offsetof(HomingConfig, position_q8)),
    number("max_travel_q8", Kind::I32, kRequired, offsetof(HomingConfig, max_travel_q8)),
    number("timeout_ms", Kind::U32, kRequired, offsetof(HomingConfig, timeout_ms)),
};
constexpr Record kHoming = record_of(kHomingFields);

constexpr Field kJointFields[] = {
    name(offsetof(JointConfig, name)),
    number("lower_q8", Kind::I32, kRequired, offsetof(JointConfig, lower_q8)),
    number("upper_q8", Kind::I32, kRequired, offsetof(JointConfig, upper_q8)),
    number("max_velocity_q8", Kind::I32, kRequired, offsetof(JointConfig, max_velocity_q8)),
    number("max_acceleration_q8", Kind::I32, kRequired, offsetof(JointConfig, max_acceleration_q8)),
    number("inverted", Kind::Truth, kOptional, offsetof(JointConfig, is_inverted)),
    number("dir_setup_us", Kind::U32, kOptional, offsetof(JointConfig, dir_setup_us)),
    number("step_pin", Kind::U8, kOptional, offsetof(JointConfig, step_pin)),
    number("dir_pin", Kind::U8, kOptional, offsetof(JointConfig, dir_pin)),
    number("text_scale_q32", Kind::U64, kOptional, offsetof(JointConfig, text_scale_q32)),
    Field{"homing", Kind::Record, kOptional, offsetof(JointConfig, homing), 0, nullptr, &kHoming},
};
constexpr Record kJoint = record_of(kJointFields);

constexpr Field kInputFields[] = {
    name(offsetof(InputConfig, name)),
    number("pin", Kind::U8, kRequired, offsetof(InputConfig, pin)),
    word("role", kRequired, offsetof(InputConfig, role), kRoles),
    number("joint", Kind::U8, kOptional, offsetof(InputConfig, joint)),
    number("inverted", Kind::Truth, kOptional, offsetof(InputConfig, is_inverted)),
    word("pull", kOptional, offsetof(InputConfig, pull), kPulls),
};
constexpr Record kInput = record_of(kInputFields);

constexpr Field kOutputFields[] = {
    name(offsetof(OutputConfig, name)),
    number("pin", Kind::U8, kRequired, offsetof(OutputConfig, pin)),
    number("inverted", Kind::Truth, kOptional, offsetof(OutputConfig, is_inverted)),
    number("at_boot", Kind::Truth, kOptional, offsetof(OutputConfig, at_boot)),
    number("off_at_estop", Kind::Truth, kOptional, offsetof(OutputConfig, is_off_at_estop)),
};
constexpr Record kOutput = record_of(kOutputFields);

constexpr Field kSensorFields[] = {
    name(offsetof(SensorConfig, name)),
    word("kind", kRequired, offsetof(SensorConfig, kind), kSensorKinds),
    number("pin", Kind::U8, kRequired, offsetof(SensorConfig, pin)),
    number("trigger_pin", Kind::U8, kOptional, offsetof(SensorConfig, trigger_pin)),
    number("scale_q16", Kind::I32, kOptional, offsetof(SensorConfig, scale_q16)),
    number("offset_milli", Kind::I32, kOptional, offsetof(SensorConfig, offset_milli)),
};
constexpr Record kSensor = record_of(kSensorFields);

constexpr Field kServoFields[] = {
    name(offsetof(ServoConfig, name)),
    number("pin", Kind::Index, kRequired, offsetof(ServoConfig, pin)),
    number("lower_us", Kind::U32, kRequired, offsetof(ServoConfig, lower_us)),
    number("upper_us", Kind::U32, kRequired, offsetof(ServoConfig, upper_us)),
    number("speed_us_s", Kind::U32, kRequired, offsetof(ServoConfig, speed_us_s)),
    number("off_at_estop", Kind::Truth, kOptional, offsetof(ServoConfig, is_off_at_estop)),
};
constexpr Record kServo = record_of(kServoFields);

constexpr Field list(const char* key, bool is_required, size_t offset, uint8_t capacity, const Record* record,
                     size_t stride, size_t count_offset) {
    return Field{key,
                 Kind::List,
                 is_required,
                 static_cast<uint16_t>(offset),
                 capacity,
                 nullptr,
                 record,
                 static_cast<uint16_t>(stride),
                 static_cast<uint16_t>(count_offset)};
}

constexpr Field kDeviceFields[] = {
    name(offsetof(DeviceConfig, name)),
    list("joints", kRequired, offsetof(DeviceConfig, joint), kMaxJoints, &kJoint, sizeof(JointConfig),
         offsetof(DeviceConfig, joints)),
    number("tick_hz", Kind::U32, kOptional, offsetof(DeviceConfig, tick_hz)),
    number("queue_capacity", Kind::U32, kOptional, offsetof(DeviceConfig, queue_capacity)),
    number("state_hz", Kind::U32, kOptional, offsetof(DeviceConfig, state_hz)),
    number("sensor_hz", Kind::U32, kOptional, offsetof(DeviceConfig, sensor_hz)),
    number("hold_timeout_ms", Kind::U32, kOptional, offsetof(DeviceConfig, hold_timeout_ms)),
    number("enable_lead_ms", Kind::U32, kOptional, offsetof(DeviceConfig, enable_lead_ms)),
    number("armed_at_boot", Kind::Truth, kOptional, offsetof(DeviceConfig, is_armed_at_boot)),
    number("enable_pin", Kind::U8, kOptional, offsetof(DeviceConfig, enable_pin)),
    number("enable_inverted", Kind::Truth, kOptional, offsetof(DeviceConfig, is_enable_inverted)),
    list("inputs", kOptional, offsetof(DeviceConfig, input), kMaxInputs, &kInput, sizeof(InputConfig),
         offsetof(DeviceConfig, inputs)),
    list("outputs", kOptional, offsetof(DeviceConfig, output), kMaxOutputs, &kOutput, sizeof(OutputConfig),
         offsetof(DeviceConfig, outputs)),
    list("sensors", kOptional, offsetof(DeviceConfig, sensor), kMaxSensors, &kSensor, sizeof(SensorConfig),
         offsetof(DeviceConfig, sensors)),
    Field{"servo", Kind::Record, kOptional, offsetof(DeviceConfig, servo), 0, nullptr, &kServo},
};
constexpr Record kDevice = record_of(kDeviceFields);

// What schemas/device_config.py has where a key is missing.
void set_defaults(DeviceConfig* config) {
    *config = DeviceConfig{};
    config->tick_hz = 50000;
    config->queue_capacity = 128;
    config->state_hz = 50;
    config->sensor_hz = 10;
    config->hold_timeout_ms = 500;
    config->is_armed_at_boot = 1;
    for (SensorConfig& sensor : config->sensor) sensor.scale_q16 = 65536000;
}

}  // namespace

bool parse_config(const char* text, size_t size, DeviceConfig* out, Refusal* refusal) {
    *refusal = Refusal{};
    if (size > kMaxConfigText) {
        Phrase(refusal->reason, sizeof refusal->reason)
            .add("its text is longer than ")
            .add(kMaxConfigText)
            .add(" bytes");
        return false;
    }
    set_defaults(out);
    out->crc32 = crc32(reinterpret_cast<const uint8_t*>(text), size);
    if (!read_record(text, size, kDevice, out, refusal)) return false;
    const ConfigFault fault = find_fault(*out);
    if (fault.sentence == nullptr) return true;
    Phrase(refusal->part, sizeof refusal->part).add(fault.part);
    Phrase(refusal->reason, sizeof refusal->reason).add(fault.sentence);
    return false;
}

}  // namespace gemelo
