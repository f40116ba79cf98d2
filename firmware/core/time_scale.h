// The time scale s in [0, 1]: how much path time is played in a slot. Holding, starving and resuming only change s,
// so the arm never leaves its path.
#pragma once

#include <stdint.h>

#include "segment.h"

namespace gemelo {

constexpr uint32_t kFullScale = 1u << 30;  // s = 1 in Q30; chosen

// Square root, rounded down.
uint32_t root(uint64_t value);

// What the queue allows at the present point of the path.
struct Allowance {
    uint32_t ceiling_q26;  // y = s^2 here
    uint32_t slope_q30;    // by how much s falls in a slot along the ceiling
};

class TimeScale {
  public:
    void begin(const DeviceConfig& config);
    void set(uint32_t s_q30) { s_q30_ = s_q30; }
    uint32_t value() const { return s_q30_; }

    // The scale of the next slot: towards `bound`, within the joints' accelerations.
    void advance(uint32_t bound_q30, const Segment& segment, const Allowance& allowance);

  private:
    uint32_t change(const Segment& segment, bool slowing) const;
    uint32_t fall_to(uint32_t highest, const Segment& segment, uint32_t slope) const;

    uint8_t joints_ = 0;
    int64_t swing_q16_[kMaxJoints];  // A times a slot, Q16 steps/s
    uint32_t s_q30_ = 0;
};

}  // namespace gemelo
