// A hobby servo: a pulse of 500 to 2500 us, 50 times a second, whose length says where its horn is to stand.
//
// Nothing tells where the horn is: the pulse goes to its target at the configured speed, so that the horn can follow.
// Before the first command there are no pulses, and the horn is where it was left.
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

class Servo {
  public:
    void begin(const ServoConfig& config);
    bool is_there() const { return config_ != nullptr; }
    // The pulse [us] that it goes to. The first one is given at once: there is none to come from.
    void go_to(uint32_t target_us);
    // It stays where the pulse is now.
    void hold() { target_q16_ = pulse_q16_; }
    // No pulses: the horn is free.
    void release() { pulse_q16_ = target_q16_ = 0; }
    // Once a slot.
    void advance();

    bool is_moving() const { return pulse_q16_ != target_q16_; }
    uint16_t pulse_us() const { return static_cast<uint16_t>((pulse_q16_ + 0x8000) >> 16); }  // 0: no pulses
    uint16_t target_us() const { return static_cast<uint16_t>((target_q16_ + 0x8000) >> 16); }

  private:
    const ServoConfig* config_ = nullptr;
    uint32_t pulse_q16_ = 0;  // 1/65536 us
    uint32_t target_q16_ = 0;
};

}  // namespace gemelo
