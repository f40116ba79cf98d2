// One joint from where it is to where it shall be, by a trapezoid of the velocity: slot by slot, in integers, exactly.
//
// Every slot takes the highest velocity that still lets it stop on the target with equal steps of the velocity; so it
// ends there without a rest. The target and the speed may change at any time.
#pragma once

#include <stdint.h>

namespace gemelo {

class Ramp {
  public:
    // Stands at a place [Q20 steps]; accelerates with so much [Q24.8 steps/s^2].
    void begin(int64_t position_q20, int32_t acceleration_q8);
    void go(int64_t target_q20) { target_q24_ = target_q20 * 16; }
    // No faster than this [Q24.8 steps/s].
    void set_speed(int32_t speed_q8);
    // The joint has come to a stand: goes on from rest.
    void pause() { velocity_q24_ = 0; }
    // The same place by another count: there and its target.
    void shift(int64_t by_q20);

    // One slot: on towards the target, or to rest wherever that is.
    void advance(bool brakes);

    int64_t position_q20() const { return position_q24_ >> 4; }
    bool is_still() const { return velocity_q24_ == 0; }
    bool is_there() const { return is_still() && position_q24_ == target_q24_; }

  private:
    int64_t highest(int64_t distance_q24) const;

    // Steps, steps per slot, steps per slot^2.
    int64_t position_q24_ = 0;
    int64_t target_q24_ = 0;
    int64_t velocity_q24_ = 0;
    int64_t speed_q24_ = 0;
    int64_t acceleration_q24_ = 1;
    int64_t braking_q24_ = 0;  // from full speed to rest
};

}  // namespace gemelo
