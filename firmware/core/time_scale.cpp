#include "time_scale.h"

#include "ceiling.h"

namespace gemelo {
namespace {

constexpr uint32_t kFastestChange = kFullScale / 4;  // a slot; chosen: to rest within 4 slots where no joint swings
constexpr int32_t kSlowJoint = 256;                  // 1 step/s; chosen: slower ones count as this fast
constexpr uint32_t kSlowest = 256;                   // chosen: creeps on to the last knot instead of never reaching it

uint32_t wide_root(uint64_t value) {
    uint64_t rest = value, result = 0;
    for (uint64_t bit = 1ull << 62; bit != 0; bit >>= 2) {
        if (rest >= result + bit) {
            rest -= result + bit;
            result = (result >> 1) + bit;
        } else {
            result >>= 1;
        }
    }
    return static_cast<uint32_t>(result);
}

uint64_t square(uint32_t value) { return static_cast<uint64_t>(value) * value; }

}  // namespace

// Digit by digit; the rest stays below twice the result, so that 32 bits do for results of 30.
uint32_t root(uint64_t value) {
    if (value >> 60 != 0) return wide_root(value);
    uint32_t high = static_cast<uint32_t>(value >> 28), low = static_cast<uint32_t>(value << 4);
    uint32_t rest = 0, result = 0;
    for (int pair = 0; pair < 30; ++pair) {
        rest = rest << 2 | high >> 30;
        high = high << 2 | low >> 30;
        low <<= 2;
        result <<= 1;
        const uint32_t digit = result << 1 | 1;
        if (rest < digit) continue;
        rest -= digit;
        ++result;
    }
    return result;
}

void TimeScale::begin(const DeviceConfig& config) {
    joints_ = static_cast<uint8_t>(config.joints);
    for (uint8_t j = 0; j < joints_; ++j)
        swing_q16_[j] = with_margin(config.joint[j].max_acceleration_q8) * 256 / kSlotHz;
    s_q30_ = 0;
}

// ds = (A -/+ a y) / |v| for the joint that has least to give.
uint32_t TimeScale::change(const Segment& segment, bool slowing) const {
    const int64_t y_q30 = (static_cast<int64_t>(s_q30_) * s_q30_) >> 30;
    int64_t least = kFastestChange;
    for (uint8_t j = 0; j < joints_; ++j) {
        const Drift& drift = segment.drift[j];
        if (drift.speed_q8 == 0) continue;
        int64_t own_q16 = segment.own_q16[j];
        if (slowing || drift.reverses) own_q16 = -own_q16;
        own_q16 = own_q16 > 0 ? (own_q16 * y_q30) >> 30 : 0;
        const int64_t room_q16 = swing_q16_[j] > own_q16 ? swing_q16_[j] - own_q16 : 0;
        const uint32_t speed_q8 = drift.speed_q8 > kSlowJoint ? static_cast<uint32_t>(drift.speed_q8) : kSlowJoint;
        const int64_t change_q30 = room_q16 * (UINT32_MAX / speed_q8) >> 10;
        if (change_q30 < least) least = change_q30;
    }
    return static_cast<uint32_t>(least);
}

// Onto the ceiling, as steeply as the joints can; where it is a joint's own limit, hardly steeper than it falls.
uint32_t TimeScale::fall_to(uint32_t highest, const Segment& segment, uint32_t slope) const {
    uint32_t most = slope + slope / 64 > kSlowest ? slope + slope / 64 : kSlowest;
    const uint32_t able = change(segment, true);
    if (able > most) most = able;
    const uint32_t lowest = s_q30_ > most ? s_q30_ - most : 0;
    return highest > lowest ? highest : lowest;
}

void TimeScale::advance(uint32_t bound_q30, const Segment& segment, const Allowance& allowance) {
    const bool is_unbounded = allowance.ceiling_q26 >= kFullCeiling && allowance.slope_q30 == 0;
    if (is_unbounded && s_q30_ == bound_q30) return;
    const bool is_slowing = s_q30_ > bound_q30;
    const uint32_t step = change(segment, is_slowing);
    uint32_t next = bound_q30;
    if (is_slowing && s_q30_ - bound_q30 > step) next = s_q30_ - step;
    if (!is_slowing && bound_q30 - s_q30_ > step) next = s_q30_ + step;
    if (!is_unbounded) {
        // Half a slot's fall above the curve at the slot's end, so that s falls by equal amounts and ends on the last
        // knot.
        const uint32_t above = allowance.slope_q30 / 2 > kSlowest ? allowance.slope_q30 / 2 : kSlowest;
        const uint64_t ceiling_q60 = static_cast<uint64_t>(allowance.ceiling_q26) << 34;
        if (next > above && square(next - above) > ceiling_q60)
            next = fall_to(root(ceiling_q60) + above, segment, allowance.slope_q30);
    }
    s_q30_ = next;
}

}  // namespace gemelo
