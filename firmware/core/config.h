// A device's configuration: its clock rates, its pins and, per joint, its limits and its driver's demands.
#pragma once

#include <stdint.h>

// A board with less memory is built for fewer.
#ifndef GEMELO_MAX_JOINTS
#define GEMELO_MAX_JOINTS 8
#endif

namespace gemelo {

constexpr uint8_t kMaxJoints = GEMELO_MAX_JOINTS;
constexpr uint16_t kMaxKnots = 128;      // chosen: 2.56 s of a path at 20 ms a knot
constexpr uint32_t kSlotUs = 1000;       // standard: the period of FreeRTOS's tick at 1 kHz
constexpr uint32_t kSlotHz = 1000;       // follows from kSlotUs
constexpr uint32_t kMaxTickHz = 100000;  // chosen: 50,000 steps/s
constexpr uint8_t kNameSize = 32;        // chosen; with the 0 at its end
constexpr uint8_t kMaxInputs = 16;       // follows from STATE: a bit each in 16
constexpr uint8_t kMaxOutputs = 8;       // chosen
constexpr uint8_t kMaxSensors = 8;       // chosen
constexpr uint8_t kMaxPin = 63;          // follows from the masks of pins: 64 bits
constexpr uint8_t kNone = 255;           // no pin, no joint, no input

// How a joint finds its place: fast to its switch, off it, slowly to it again. Travels in Q24.8 steps.
struct HomingConfig {
    uint8_t input = kNone;  // the switch, or kNone for a joint that cannot home
    uint8_t group;          // joints of one group home together, lower groups first
    int8_t direction;       // of travel towards the switch: 1 or -1
    int32_t fast_q8;        // steps/s
    int32_t slow_q8;        // steps/s
    int32_t back_off_q8;
    int32_t position_q8;    // where the joint is when the switch closes
    int32_t max_travel_q8;  // on the way to the switch
    uint32_t timeout_ms;    // of the joint's whole homing
};

// Positions are absolute motor steps in Q24.8, velocities Q24.8 steps/s, accelerations Q24.8 steps/s^2.
struct JointConfig {
    char name[kNameSize];
    int32_t lower_q8;
    int32_t upper_q8;
    int32_t max_velocity_q8;
    int32_t max_acceleration_q8;
    uint32_t dir_setup_us;  // DIR stands still for so long before STEP rises
    uint8_t is_inverted;    // DIR is high for negative travel
    uint8_t step_pin = kNone;
    uint8_t dir_pin = kNone;
    uint64_t text_scale_q32;  // 1/256 steps per 1e-7 rad or m, for text mode; 0: the joint has none
    HomingConfig homing;
};

enum class InputRole : uint8_t { EStop, LimitLower, LimitUpper, Home };
enum class Pull : uint8_t { None, Up, Down };

struct InputConfig {
    char name[kNameSize];
    uint8_t pin = kNone;
    InputRole role;
    uint8_t joint = kNone;  // that the switch belongs to; kNone for the e-stop
    uint8_t is_inverted;    // active at low level
    Pull pull;
};

struct OutputConfig {
    char name[kNameSize];
    uint8_t pin = kNone;
    uint8_t is_inverted;
    uint8_t at_boot;          // the logical level after a start
    uint8_t is_off_at_estop;  // an e-stop switches it off
};

enum class SensorKind : uint8_t { Analog, Ultrasonic };  // raw value in mV, or the echo's length in us

// value [1/1000] = raw * scale_q16 / 65536 + offset_milli
struct SensorConfig {
    char name[kNameSize];
    SensorKind kind;
    uint8_t pin = kNone;
    uint8_t trigger_pin = kNone;  // Ultrasonic
    int32_t scale_q16;
    int32_t offset_milli;
};

constexpr uint32_t kLeastServoUs = 500;  // standard: the shortest pulse of hobby servos
constexpr uint32_t kMostServoUs = 2500;  // standard: the longest pulse of hobby servos

// Pulse lengths in us; the pulse changes by speed_us_s, so that the horn can follow.
struct ServoConfig {
    char name[kNameSize];
    uint8_t pin = kNone;  // kNone: there is no servo
    uint32_t lower_us;
    uint32_t upper_us;
    uint32_t speed_us_s;
    uint8_t is_off_at_estop;  // an e-stop ends its pulses: the horn is free then
};

struct DeviceConfig {
    char name[kNameSize];
    uint32_t crc32;           // of the text that this was read from; 0: not from a text
    uint32_t tick_hz;         // a multiple of 1000
    uint32_t queue_capacity;  // knots
    uint32_t state_hz;        // a divisor of 1000
    uint32_t sensor_hz;       // a divisor of 1000
    uint32_t hold_timeout_ms;
    uint32_t enable_lead_ms;  // from enabling the drivers to the first step
    uint8_t is_armed_at_boot;
    uint8_t enable_pin = kNone;
    uint8_t is_enable_inverted;  // the drivers are enabled at low level
    uint8_t joints;
    uint8_t inputs;
    uint8_t outputs;
    uint8_t sensors;
    JointConfig joint[kMaxJoints];
    InputConfig input[kMaxInputs];
    OutputConfig output[kMaxOutputs];
    SensorConfig sensor[kMaxSensors];
    ServoConfig servo;
};

// What is wrong with a configuration: a sentence, and the part it is about.
struct ConfigFault {
    const char* sentence = nullptr;  // nullptr: nothing is wrong
    const char* part = "";           // name of the joint, input, output, sensor or servo; empty for the device
};

ConfigFault find_fault(const DeviceConfig& config);

// 1 to 31 letters, digits, '_' or '-'.
bool is_name(const char* name);

inline uint32_t ticks_per_slot(const DeviceConfig& config) { return config.tick_hz / kSlotHz; }

// The fastest this joint may turn: its own limit, or one pulse in two ticks.
int32_t velocity_limit_q8(const DeviceConfig& config, uint8_t joint);

}  // namespace gemelo
