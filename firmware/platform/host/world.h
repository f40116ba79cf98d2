// The world at a virtual device's pins: motors with their shafts, switches that the shafts close, and a button.
#pragma once

#include "config.h"
#include "horn.h"
#include "motor.h"
#include "stepper.h"

namespace gemelo {

// What a person does to a switch.
enum class Press : uint8_t { Left, Held, HeldOpen };

class World {
  public:
    World() {
        for (Press& press : press_) press = Press::Left;
    }
    // Ideal until said; counts from the next wire() on.
    void set_motor(uint8_t joint, const MotorConfig& motor) { motor_config_[joint] = motor; }
    void set_shaft(uint8_t joint, int32_t pulses) { shaft_[joint] = pulses; }
    void set_horn(const HornConfig& horn) {
        horn_.begin(horn);
        read_horn();
    }
    // The pins are connected as `config` says; shafts stay where they are. `pins` are the present levels.
    void wire(const DeviceConfig& config, const Pins& pins);

    // After every tick of the stepper.
    void tick(const Pins& pins);
    void enable(bool is_enabled);
    // A slot under this pulse of the servo; 0 us: none.
    void turn_horn(uint32_t pulse_us);
    Horn& horn() { return horn_; }
    const Horn& horn() const { return horn_; }
    // What the next tick reads.
    const Levels& levels() const { return levels_; }
    // No shaft moves by itself, and the switches have been read as they are.
    bool is_settled() const { return unread_ == 0 && are_motors_settled(); }

    // A board that starts anew wakes up in the world that it was in: what is pressed, blocked and measured stays.
    void inherit(const World& before);
    void press(uint8_t input, Press press);
    void block(uint8_t joint, bool is_blocked);
    void slip(uint8_t joint, int32_t pulses);
    // What the sensor is to read from now on, in its own unit.
    void set_sensor(uint8_t sensor, double value);
    // mV at the pin, or us of echo.
    int32_t sensor_raw(uint8_t sensor) const { return raw_[sensor]; }
    int32_t shaft(uint8_t joint) const { return shaft_[joint]; }

  private:
    // A switch is closed while sign * shaft >= threshold; never for sign 0.
    struct Switch {
        uint8_t joint;
        int8_t sign;
        int64_t threshold_q8;
    };

    static Switch switch_of(const DeviceConfig& config, uint8_t input);
    bool is_active(uint8_t input) const;
    bool are_motors_settled() const;
    void follow(uint8_t joint);
    void read_switches();
    void read_horn();

    static constexpr uint8_t kReadings = 8;  // ticks after a change until nothing new can come of it

    MotorConfig motor_config_[kMaxJoints];
    Motor motor_[kMaxJoints];
    int32_t shaft_[kMaxJoints] = {};
    bool is_blocked_[kMaxJoints] = {};
    Switch switch_[kMaxInputs] = {};
    Press press_[kMaxInputs];
    Horn horn_;
    int32_t raw_[kMaxSensors] = {};
    DeviceConfig config_{};
    Pins pins_;
    Levels levels_;
    bool is_enabled_ = true;
    uint8_t unread_ = kReadings;
};

}  // namespace gemelo
