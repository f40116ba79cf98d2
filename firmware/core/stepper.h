// The tick: phase accumulators that become step pulses. No floats, no division, no locks.
//
// A position is counted in 1 / (2^20 T) steps, T being the ticks of a slot, so T equal increments reach the slot's
// end exactly and the executed count there is floor(p + 0.5).
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

// Levels of GPIO 0 to 31 and 32 to 63, as the pins have them.
struct Levels {
    uint32_t low = 0;
    uint32_t high = 0;
};

// Levels after a tick: bit j is joint j.
struct Pins {
    uint32_t step = 0;
    uint32_t dir = 0;
};

class Stepper {
  public:
    void begin(const DeviceConfig& config);

    // Only at rest: the executed count becomes floor(p + 0.5).
    void place(const int64_t* position_q20);

    // The slot task's side: increments of the slot after the present one, Q20 steps.
    void offer(const int32_t* increment_q20);
    bool wants_offer() const { return !__atomic_load_n(&is_offered_, __ATOMIC_ACQUIRE); }
    // Forgets offers that are out and stops pulsing at the next slot (a fault).
    void silence();

    // The interrupt's side.
    // Reads the e-stop and the switches, then steps.
    void tick(const Levels& levels = Levels{});
    // `count` ticks within a slot in which nothing happens; only allowed while is_quiet().
    void skip(uint32_t count);

    const Pins& pins() const { return pins_; }
    bool is_quiet() const;
    int32_t executed(uint8_t joint) const { return axis_[joint].executed; }

    // As of the end of the last whole slot.
    int32_t latched(uint8_t joint) const { return axis_[joint].latched; }
    uint32_t latched_number() const { return latched_number_; }  // of the offer that ended then
    bool has_overrun() const { return missed_ >= kMaxMissed; }

    // The time of the first pulse after watch(), in ticks before (negative: after) the present slot began.
    void watch() { is_watching_ = true; }
    bool is_watching() const { return is_watching_; }
    int32_t ticks_since_first_pulse() const { return static_cast<int32_t>(slot_tick_ - first_pulse_tick_); }

  private:
    struct Axis {
        int32_t phase;
        int32_t increment;
        int32_t executed;
        int32_t latched;
        int16_t owed;  // steps due that no pulse was made for yet
        int8_t direction;
        uint8_t wait;  // ticks until DIR has been still for long enough
        uint8_t setup;
        bool is_high;
        bool is_inverted;
    };

    void take();
    void latch();
    void step(Axis& axis, uint32_t bit);
    void turn(Axis& axis, uint32_t bit, int8_t direction, uint8_t wait);

    static constexpr uint8_t kMaxMissed = 3;  // slots

    Axis axis_[kMaxJoints];
    Pins pins_;
    int32_t offered_[kMaxJoints];
    uint8_t joints_ = 0;
    uint8_t missed_ = 0;
    bool is_offered_ = false;
    bool is_watching_ = false;
    uint32_t ticks_per_slot_ = 0;
    int32_t whole_step_ = 0;
    uint32_t tick_in_slot_ = 0;
    uint32_t tick_ = 0;  // wraps
    uint32_t slot_tick_ = 0;
    uint32_t first_pulse_tick_ = 0;
    uint32_t taken_number_ = 0;
    uint32_t latched_number_ = 0;
};

}  // namespace gemelo
