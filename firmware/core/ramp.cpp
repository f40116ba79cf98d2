#include "ramp.h"

#include "config.h"
#include "time_scale.h"

namespace gemelo {
namespace {

// Rounding may ask for this much more of a change of the velocity.
constexpr int64_t kRounding = 4;

int64_t per_slot_q24(int64_t value_q8) { return value_q8 * 65536 / kSlotHz; }

int64_t clamp(int64_t value, int64_t low, int64_t high) { return value < low ? low : (value > high ? high : value); }

}  // namespace

void Ramp::begin(int64_t position_q20, int32_t acceleration_q8) {
    position_q24_ = target_q24_ = position_q20 * 16;
    velocity_q24_ = speed_q24_ = braking_q24_ = 0;
    acceleration_q24_ = per_slot_q24(acceleration_q8) / kSlotHz;
    if (acceleration_q24_ < 1) acceleration_q24_ = 1;
}

void Ramp::set_speed(int32_t speed_q8) {
    speed_q24_ = per_slot_q24(speed_q8);
    braking_q24_ = speed_q24_ * speed_q24_ / (2 * acceleration_q24_) + speed_q24_ + acceleration_q24_;
}

void Ramp::shift(int64_t by_q20) {
    position_q24_ += by_q20 * 16;
    target_q24_ += by_q20 * 16;
}

void Ramp::advance(bool brakes) {
    const int64_t rest = target_q24_ - position_q24_;
    int64_t wanted = 0;
    if (!brakes && rest != 0) wanted = rest > 0 ? highest(rest) : -highest(-rest);
    const int64_t change = acceleration_q24_ + kRounding;
    velocity_q24_ = clamp(wanted, velocity_q24_ - change, velocity_q24_ + change);
    position_q24_ += velocity_q24_;
}

// The largest v whose stop, v + (v - a) + (v - 2 a) + ..., is no longer than the distance: with n whole steps of a in
// v it is (n + 1) v - a n (n + 1) / 2.
int64_t Ramp::highest(int64_t distance) const {
    if (distance >= braking_q24_) return speed_q24_;
    const int64_t a = acceleration_q24_;
    const int64_t n = (static_cast<int64_t>(root(static_cast<uint64_t>(8 * distance / a + 1))) - 1) / 2;
    const int64_t v = (distance + a * (n * (n + 1) / 2)) / (n + 1);
    return v < speed_q24_ ? v : speed_q24_;
}

}  // namespace gemelo
