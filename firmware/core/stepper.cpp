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

}  // namespace

void Stepper::begin(const DeviceConfig& config) {
    joints_ = static_cast<uint8_t>(config.joints);
    ticks_per_slot_ = ticks_per_slot(config);
    whole_step_ = static_cast<int32_t>(ticks_per_slot_ << kFineBits);
    tick_in_slot_ = tick_ = slot_tick_ = 0;
    missed_ = 0;
    is_watching_ = false;
    pins_ = Pins{};
    for (uint8_t j = 0; j < joints_; ++j) {
        Axis& axis = axis_[j];
        axis = Axis{};
        axis.setup = setup_ticks(config, j);
        axis.is_inverted = config.joint[j].is_inverted != 0;
        turn(axis, 1u << j, 1, 0);
        offered_[j] = 0;
    }
    taken_number_ = latched_number_ = 0;
    is_offered_ = true;
}

void Stepper::place(const int64_t* position_q20) {
    for (uint8_t j = 0; j < joints_; ++j) {
        const int64_t shifted = position_q20[j] + kHalfStep;
        axis_[j].executed = axis_[j].latched = static_cast<int32_t>(shifted >> kFineBits);
        const int64_t fraction = shifted & ((1 << kFineBits) - 1);
        axis_[j].phase = static_cast<int32_t>(fraction * ticks_per_slot_);
    }
}

void Stepper::offer(const int32_t* increment_q20) {
    for (uint8_t j = 0; j < joints_; ++j) offered_[j] = increment_q20[j];
    __atomic_store_n(&is_offered_, true, __ATOMIC_RELEASE);
}

void Stepper::silence() {
    for (uint8_t j = 0; j < joints_; ++j) {
        axis_[j].increment = offered_[j] = 0;
        axis_[j].owed = 0;
    }
}

void Stepper::tick(const Levels&) {
    if (tick_in_slot_ == 0) take();
    for (uint8_t j = 0; j < joints_; ++j) step(axis_[j], 1u << j);
    ++tick_;
    if (++tick_in_slot_ == ticks_per_slot_) latch();
}

void Stepper::skip(uint32_t count) {
    tick_ += count;
    tick_in_slot_ += count;
    if (tick_in_slot_ == ticks_per_slot_) latch();
}

void Stepper::take() {
    slot_tick_ = tick_;
    const bool is_offered = __atomic_load_n(&is_offered_, __ATOMIC_ACQUIRE);
    if (is_offered) {
        missed_ = 0;
        ++taken_number_;
    } else if (missed_ < kMaxMissed) {
        ++missed_;
    }
    for (uint8_t j = 0; j < joints_; ++j) {
        Axis& axis = axis_[j];
        axis.increment = is_offered ? offered_[j] : 0;
        const int8_t direction = axis.increment > 0 ? 1 : -1;
        // DIR turns before the first step is due; one tick more, because step() counts this tick too.
        if (axis.increment != 0 && axis.owed == 0 && direction != axis.direction)
            turn(axis, 1u << j, direction, static_cast<uint8_t>(axis.setup + 1));
    }
    if (is_offered) __atomic_store_n(&is_offered_, false, __ATOMIC_RELEASE);
}

void Stepper::latch() {
    tick_in_slot_ = 0;
    for (uint8_t j = 0; j < joints_; ++j) axis_[j].latched = axis_[j].executed;
    latched_number_ = taken_number_;
}

void Stepper::step(Axis& axis, uint32_t bit) {
    axis.phase += axis.increment;
    if (axis.phase >= whole_step_) {
        axis.phase -= whole_step_;
        ++axis.owed;
    } else if (axis.phase < 0) {
        axis.phase += whole_step_;
        --axis.owed;
    }
    if (axis.wait != 0) --axis.wait;
    if (axis.is_high) {
        axis.is_high = false;
        pins_.step &= ~bit;
        return;
    }
    if (axis.owed == 0) return;
    const int8_t direction = axis.owed > 0 ? 1 : -1;
    if (direction != axis.direction) {
        turn(axis, bit, direction, axis.setup);
        return;
    }
    if (axis.wait != 0) return;
    axis.is_high = true;
    pins_.step |= bit;
    axis.executed += direction;
    axis.owed = static_cast<int16_t>(axis.owed - direction);
    if (!is_watching_) return;
    is_watching_ = false;
    first_pulse_tick_ = tick_;
}

void Stepper::turn(Axis& axis, uint32_t bit, int8_t direction, uint8_t wait) {
    axis.direction = direction;
    axis.wait = wait;
    const bool is_high = (direction > 0) != axis.is_inverted;
    pins_.dir = is_high ? pins_.dir | bit : pins_.dir & ~bit;
}

bool Stepper::is_quiet() const {
    for (uint8_t j = 0; j < joints_; ++j) {
        const Axis& axis = axis_[j];
        if (axis.increment != 0 || axis.owed != 0 || axis.is_high || axis.wait != 0) return false;
    }
    return true;
}

}  // namespace gemelo
