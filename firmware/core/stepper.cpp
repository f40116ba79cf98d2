#include "stepper.h"

#include "segment.h"

namespace gemelo {
namespace {

constexpr int64_t kHalfStep = 1 << (kFineBits - 1);

uint8_t setup_ticks(const DeviceConfig& config, uint8_t joint) {
    const uint64_t scaled = static_cast<uint64_t>(config.joint[joint].dir_setup_us) * config.tick_hz;
    const uint64_t ticks = (scaled + 999999) / 1000000;
    return static_cast<uint8_t>(ticks < 1 ? 1 : ticks);
}

// What stands before in the program is done before, as the interrupt sees it.
void keep_order() { __atomic_signal_fence(__ATOMIC_SEQ_CST); }

}  // namespace

void Stepper::begin(const DeviceConfig& config) {
    stop_for_begin();
    joints_ = config.joints;
    ticks_per_slot_ = ticks_per_slot(config);
    whole_step_ = ticks_per_slot_ << kFineBits;
    slot_tick_ = due_ = waiting_ = guarded_ = 0;
    missed_ = 0;
    is_watching_ = was_moving_ = false;
    trip_ = Trip::None;
    trip_input_ = kNone;
    pins_ = Pins{};
    for (uint8_t i = 0; i < kMaxInputs; ++i) {
        joint_of_[i] = i < config.inputs ? config.input[i].joint : kNone;
        has_closed_[i] = false;
    }
    for (uint8_t j = 0; j < joints_; ++j) {
        wheel_[j] = Wheel{};
        axis_[j] = Axis{};
        axis_[j].setup = setup_ticks(config, j);
        axis_[j].is_inverted = config.joint[j].is_inverted != 0;
        axis_[j].direction = -1;
        turn(axis_[j], 1u << j, 0);
        offered_[j] = 0;
    }
    waiting_ = busy_ = 0;
    taken_number_ = latched_number_ = 0;
    is_offered_ = true;
    watch_.begin(config);
    if (joints_ == 0) return;
    keep_order();
    end_ = wheel_ + joints_;
    left_ = 0;
}

// From here on a tick only counts down, and turns a wheel that stands.
void Stepper::stop_for_begin() {
    left_ = kNever;
    end_ = wheel_ + 1;
    busy_ = 0;
    watch_.blind();
    keep_order();
}

void Stepper::place(const int64_t* position_q20) {
    for (uint8_t j = 0; j < joints_; ++j) {
        const int64_t shifted = position_q20[j] + kHalfStep;
        axis_[j].executed = axis_[j].latched = static_cast<int32_t>(shifted >> kFineBits);
        const int64_t fraction = shifted & ((1 << kFineBits) - 1);
        wheel_[j].phase = static_cast<int32_t>(fraction * ticks_per_slot_);
    }
}

void Stepper::shift(uint8_t joint, int32_t steps) {
    axis_[joint].executed += steps;
    axis_[joint].latched = axis_[joint].executed;
}

void Stepper::offer(const int32_t* increment_q20) {
    for (uint8_t j = 0; j < joints_; ++j) offered_[j] = increment_q20[j];
    __atomic_store_n(&is_offered_, true, __ATOMIC_RELEASE);
}

// In this order: a wheel that stands owes nothing new, and what is not due is not looked at.
void Stepper::silence() {
    for (uint8_t j = 0; j < joints_; ++j) offered_[j] = 0;
    keep_order();
    for (uint8_t j = 0; j < joints_; ++j) wheel_[j].increment = 0;
    keep_order();
    due_ = 0;
    keep_order();
    for (uint8_t j = 0; j < joints_; ++j) axis_[j].owed = 0;
}

void Stepper::release() {
    trip_ = Trip::None;
    keep_order();
    if (is_estop_active()) trip_ = Trip::EStop;
}

// In most ticks no input has changed, no slot begins or ends and no pulse is due: those need no more than this.
void Stepper::tick(const Levels& levels) {
    if (watch_.differs(levels) || left_ < 2 || busy_ != 0) return tick_in_full(levels);
    --left_;
    const uint32_t carried = turn_wheels();
    if (carried != 0) step(carried);
}

void Stepper::tick_in_full(const Levels& levels) {
    if (left_ == 0) take();
    if (watch_.differs(levels)) inspect(levels);
    --left_;
    const uint32_t carried = turn_wheels();
    if ((carried | busy_) != 0) step(carried);
    if (left_ == 0) latch();
}

// The joints whose phase has left [0, whole_step_), at one end or the other.
[[gnu::always_inline]] inline uint32_t Stepper::turn_wheels() {
    const uint32_t whole = whole_step_;
    const Wheel* const end = end_;
    uint32_t carried = 0;
    Wheel* wheel = wheel_;
    do {
        wheel->phase += wheel->increment;
        if (static_cast<uint32_t>(wheel->phase) >= whole) carried |= 1u << (wheel - wheel_);
    } while (++wheel != end);
    return carried;
}

[[gnu::always_inline]] inline void Stepper::carry(uint8_t joint) {
    const bool is_forward = wheel_[joint].phase >= 0;
    const int32_t whole = static_cast<int32_t>(whole_step_);
    wheel_[joint].phase += is_forward ? -whole : whole;
    axis_[joint].owed = static_cast<int16_t>(axis_[joint].owed + (is_forward ? 1 : -1));
    const uint32_t bit = 1u << joint;
    due_ = axis_[joint].owed != 0 ? due_ | bit : due_ & ~bit;
}

[[gnu::always_inline]] inline bool Stepper::begin_pulse(uint8_t joint, uint32_t bit) {
    Axis& axis = axis_[joint];
    if ((axis.owed > 0) != (axis.direction > 0)) {
        turn(axis, bit, axis.setup);
        return false;
    }
    if (axis.wait != 0) return false;
    axis.executed += axis.direction;
    axis.owed = static_cast<int16_t>(axis.owed - axis.direction);
    if (axis.owed == 0) due_ &= ~bit;
    return true;
}

void Stepper::step(uint32_t carried) {
    for (uint8_t j = 0; carried != 0; ++j, carried >>= 1)
        if ((carried & 1) != 0) carry(j);
    if (waiting_ != 0) settle();
    uint32_t rest = due_ & ~pins_.step;
    uint32_t high = 0;
    for (uint8_t j = 0; rest != 0; ++j, rest >>= 1)
        if ((rest & 1) != 0 && begin_pulse(j, 1u << j)) high |= 1u << j;
    pins_.step = high;
    busy_ = due_ | waiting_ | high;
    if (high == 0 || !is_watching_) return;
    is_watching_ = false;
    first_pulse_tick_ = now() - 1;
}

void Stepper::skip(uint32_t count) {
    left_ -= count;
    if (left_ == 0) latch();
}

void Stepper::inspect(const Levels& levels) {
    const uint32_t risen = watch_.read(levels, now());
    if (risen == 0) return;
    if ((risen & watch_.estops()) != 0) {
        trip(Trip::EStop, risen & watch_.estops());
    } else if ((risen & guarded_) != 0 && trip_ == Trip::None) {
        trip(Trip::Limit, risen & guarded_);
    }
    for (uint8_t i = 0; i < kMaxInputs; ++i) {
        if (((risen >> i) & 1) == 0 || joint_of_[i] >= joints_) continue;
        closed_at_[i] = axis_[joint_of_[i]].executed;
        has_closed_[i] = true;
    }
}

void Stepper::trip(Trip trip, uint32_t inputs) {
    if (trip_ == Trip::None) was_moving_ = is_turning() || busy_ != 0;
    trip_input_ = 0;
    while (((inputs >> trip_input_) & 1) == 0) ++trip_input_;
    trip_ = trip;
    due_ = 0;
    for (uint8_t j = 0; j < joints_; ++j) {
        wheel_[j].increment = 0;
        axis_[j].owed = 0;
    }
}

void Stepper::take() {
    left_ = ticks_per_slot_;
    slot_tick_ += ticks_per_slot_;
    const bool is_offered = __atomic_load_n(&is_offered_, __ATOMIC_ACQUIRE);
    if (is_offered) {
        missed_ = 0;
        ++taken_number_;
    } else if (missed_ < kMaxMissed) {
        ++missed_;
    }
    const bool is_silent = !is_offered || trip_ != Trip::None;
    for (uint8_t j = 0; j < joints_; ++j) {
        Axis& axis = axis_[j];
        const int32_t increment = is_silent ? 0 : offered_[j];
        wheel_[j].increment = increment;
        // DIR turns before the first step is due; one tick more, because step() counts this tick too.
        if (increment != 0 && axis.owed == 0 && (increment > 0) != (axis.direction > 0))
            turn(axis, 1u << j, static_cast<uint8_t>(axis.setup + 1));
    }
    if (is_offered) __atomic_store_n(&is_offered_, false, __ATOMIC_RELEASE);
}

void Stepper::latch() {
    for (uint8_t j = 0; j < joints_; ++j) axis_[j].latched = axis_[j].executed;
    latched_number_ = taken_number_;
}

void Stepper::settle() {
    for (uint8_t j = 0; j < joints_; ++j) {
        if (axis_[j].wait != 0 && --axis_[j].wait == 0) waiting_ &= ~(1u << j);
    }
}

void Stepper::turn(Axis& axis, uint32_t bit, uint8_t wait) {
    axis.direction = static_cast<int8_t>(-axis.direction);
    axis.wait = wait;
    waiting_ |= bit;
    busy_ |= bit;
    const bool is_high = (axis.direction > 0) != axis.is_inverted;
    pins_.dir = is_high ? pins_.dir | bit : pins_.dir & ~bit;
}

bool Stepper::is_turning() const {
    for (uint8_t j = 0; j < joints_; ++j)
        if (wheel_[j].increment != 0) return true;
    return false;
}

}  // namespace gemelo
