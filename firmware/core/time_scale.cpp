#include "time_scale.h"

#include "ceiling.h"

namespace gemelo {
namespace {

constexpr uint32_t kFastestChange = kFullScale / 4;
constexpr uint32_t kSlowest = 256;  // creeps on to the last knot instead of never reaching it

uint32_t ceiling_scale(const Allowance& allowance) {
    const uint32_t half_slot = allowance.slope_q30 / 2 > kSlowest ? allowance.slope_q30 / 2 : kSlowest;
    const uint32_t highest = root(static_cast<uint64_t>(allowance.ceiling_q26) << 34);
    // Half a slot's fall above the curve at the slot's end, so that s falls by equal amounts and ends on the last knot.
    return highest + half_slot;
}

}  // namespace

uint32_t root(uint64_t value) {
    uint64_t rest = value, result = 0, bit = 1ull << 62;
    while (bit > rest) bit >>= 2;
    for (; bit != 0; bit >>= 2) {
        if (rest >= result + bit) {
            rest -= result + bit;
            result = (result >> 1) + bit;
        } else {
            result >>= 1;
        }
    }
    return static_cast<uint32_t>(result);
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
        int64_t own = slowing || drift.reverses ? -static_cast<int64_t>(drift.gain_q8) : drift.gain_q8;
        if (own < 0) own = 0;
        const int64_t own_q16 = (own * 256 * kSlotUs / segment.dt_us * y_q30) >> 30;
        const int64_t room_q16 = swing_q16_[j] > own_q16 ? swing_q16_[j] - own_q16 : 0;
        const int64_t change_q30 = (room_q16 << 22) / drift.speed_q8;
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
        const uint32_t highest = ceiling_scale(allowance);
        if (next > highest) next = fall_to(highest, segment, allowance.slope_q30);
    }
    s_q30_ = next;
}

}  // namespace gemelo
