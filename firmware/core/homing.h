// Homing: every joint fast to its switch, off it, slowly to it again, by groups. It moves the ramps; the tick latches
// where a switch closed.
#pragma once

#include <stdint.h>

#include "config.h"
#include "protocol.h"
#include "ramp.h"
#include "stepper.h"

namespace gemelo {

// What went wrong with which joint.
struct Mishap {
    FaultCode fault = FaultCode::None;
    uint8_t joint = kNone;
};

class Homing {
  public:
    // All three are kept.
    void begin(const DeviceConfig& config, Stepper& stepper, Ramp* ramps);
    // The ramps stand where the joints do. Bit j for joint j; each has a switch.
    void start(uint16_t joints);
    // One slot, before the ramps advance.
    Mishap advance();
    void stop() { open_ = 0; }

    // Joints that stand at their place since the last advance().
    uint16_t arrived() const { return arrived_; }
    // How many steps such a joint's count is to be raised by, so that the switch closed at its `position`.
    int32_t correction(uint8_t joint) const;
    bool is_over() const { return open_ == 0; }
    // Switches that may become active: those of the joints that move.
    uint32_t own_inputs() const { return own_inputs_; }

  private:
    enum class Phase : uint8_t { Releasing, Fast, BackingOff, Slow, Leaving };
    struct Way {
        Phase phase;
        uint8_t still;      // slots that the ramp has stood
        uint32_t slots;     // since its group began
        int64_t began_q20;  // this phase
        int32_t closed_at;  // step count
    };

    const HomingConfig& homing(uint8_t joint) const { return config_->joint[joint].homing; }
    bool is_active(uint8_t joint) const;
    void begin_group();
    FaultCode advance(uint8_t joint);
    void approach(uint8_t joint);
    void enter(uint8_t joint, Phase phase, int32_t direction, int64_t distance_q20, int32_t speed_q8);
    void leave_switch(uint8_t joint, Phase phase);
    bool has_travelled(uint8_t joint) const;
    bool stands(uint8_t joint);

    const DeviceConfig* config_ = nullptr;
    Stepper* stepper_ = nullptr;
    Ramp* ramp_ = nullptr;
    uint16_t open_ = 0;   // joints that are not home yet
    uint16_t group_ = 0;  // those of them that move
    uint16_t arrived_ = 0;
    uint32_t own_inputs_ = 0;
    Way way_[kMaxJoints];
};

}  // namespace gemelo
