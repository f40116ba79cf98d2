// The tick: phase accumulators that become step pulses. No floats, no division, no locks.
//
// A position is counted in 1 / (2^20 T) steps, T being the ticks of a slot, so T equal increments reach the slot's
// end exactly and the executed count there is floor(p + 0.5).
//
// The slot task and the interrupt share a core: the interrupt may come at any point of the task, never the reverse.
#pragma once

#include <stdint.h>

#include "config.h"
#include "input_watch.h"

namespace gemelo {

// Levels after a tick: bit j is joint j.
struct Pins {
    uint32_t step = 0;
    uint32_t dir = 0;
};

// What has silenced the stepper within a tick.
enum class Trip : uint8_t { None, Limit, EStop };

class Stepper {
  public:
    // Also under the running interrupt, at rest.
    void begin(const DeviceConfig& config);

    // Only at rest: the executed count becomes floor(p + 0.5).
    void place(const int64_t* position_q20);
    // The same for a joint that stands, of a whole number of steps.
    void shift(uint8_t joint, int32_t steps);

    // The slot task's side: increments of the slot after the present one, Q20 steps.
    void offer(const int32_t* increment_q20);
    bool wants_offer() const { return !__atomic_load_n(&is_offered_, __ATOMIC_ACQUIRE); }
    // Forgets offers that are out; a pulse that has begun still ends.
    void silence();

    // The interrupt's side: reads the e-stop and the switches, then steps.
    void tick(const Levels& levels);
    // `count` ticks within a slot in which nothing happens; only allowed while is_quiet(), with pins that do not
    // change.
    void skip(uint32_t count);

    const Pins& pins() const { return pins_; }
    bool is_quiet() const { return busy_ == 0 && !is_turning(); }
    bool is_quiet(const Levels& levels) const { return is_quiet() && !watch_.differs(levels); }
    int32_t executed(uint8_t joint) const { return axis_[joint].executed; }

    // Which inputs silence everything when they become active, bit i; an e-stop always does.
    void guard(uint32_t inputs) { guarded_ = inputs; }
    uint32_t active_inputs() const { return watch_.active(); }
    bool is_estop_active() const { return (watch_.active() & watch_.estops()) != 0; }
    Trip trip() const { return trip_; }
    uint8_t trip_input() const { return trip_input_; }
    bool was_moving_at_trip() const { return was_moving_; }
    // Steps again, unless the e-stop is active.
    void release();

    // Where a switch's joint was when the switch closed; forget() makes ready for the next time.
    bool has_closed(uint8_t input) const { return has_closed_[input]; }
    int32_t closed_at(uint8_t input) const { return closed_at_[input]; }
    void forget(uint8_t input) { has_closed_[input] = false; }

    // As of the end of the last whole slot.
    int32_t latched(uint8_t joint) const { return axis_[joint].latched; }
    uint32_t latched_number() const { return latched_number_; }  // of the offer that ended then
    bool has_overrun() const { return missed_ >= kMaxMissed; }

    // The time of the first pulse after watch(), in ticks before (negative: after) the present slot began.
    void watch() { is_watching_ = true; }
    bool is_watching() const { return is_watching_; }
    int32_t ticks_since_first_pulse() const { return static_cast<int32_t>(slot_tick_ - first_pulse_tick_); }

  private:
    struct Wheel {
        int32_t phase;
        int32_t increment;
    };
    struct Axis {
        int32_t executed;
        int32_t latched;
        int16_t owed;  // steps due that no pulse was made for yet
        int8_t direction;
        uint8_t wait;  // ticks until DIR has been still for long enough
        uint8_t setup;
        bool is_inverted;
    };

    bool is_turning() const;
    void stop_for_begin();
    void tick_in_full(const Levels& levels);
    void inspect(const Levels& levels);
    void trip(Trip trip, uint32_t inputs);
    uint32_t turn_wheels();
    void step(uint32_t carried);
    void carry(uint8_t joint);
    void take();
    void latch();
    void settle();
    bool begin_pulse(uint8_t joint, uint32_t bit);
    void turn(Axis& axis, uint32_t bit, uint8_t wait);
    uint32_t now() const { return slot_tick_ + ticks_per_slot_ - left_; }

    static constexpr uint8_t kMaxMissed = 3;            // slots; standard: PROTOCOL.md, TICK_OVERRUN
    static constexpr uint32_t kNever = UINT32_MAX / 2;  // ticks

    // What every tick needs stands first.
    InputWatch watch_;
    uint32_t left_ = kNever;  // ticks of the slot; 0 before its first
    uint32_t busy_ = 0;       // joints of due_, waiting_ and those with STEP high
    uint32_t whole_step_ = 0;
    Wheel* end_ = wheel_ + 1;
    Wheel wheel_[kMaxJoints] = {};

    Pins pins_;
    uint32_t due_ = 0;      // joints that owe a pulse
    uint32_t waiting_ = 0;  // joints whose DIR has just turned
    Axis axis_[kMaxJoints];
    int32_t offered_[kMaxJoints];
    uint8_t joints_ = 0;
    uint8_t missed_ = 0;
    bool is_offered_ = false;
    bool is_watching_ = false;
    bool was_moving_ = false;
    Trip trip_ = Trip::None;
    uint8_t trip_input_ = kNone;
    uint32_t ticks_per_slot_ = 0;
    uint32_t slot_tick_ = 0;  // of the slot's first; wraps
    uint32_t first_pulse_tick_ = 0;
    uint32_t taken_number_ = 0;
    uint32_t latched_number_ = 0;

    uint32_t guarded_ = 0;
    bool has_closed_[kMaxInputs];
    int32_t closed_at_[kMaxInputs];
    uint8_t joint_of_[kMaxInputs];
};

}  // namespace gemelo
