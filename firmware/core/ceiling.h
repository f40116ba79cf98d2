// The highest speed along the path from which it can still be stopped at the last known knot.
//
// With the time scale s (1 plays as planned) and y = s^2, a joint's acceleration is a y + v y' / 2, where v and a
// are the path's own and y' = dy/d(path time). Bounding it by the limit A, going backwards from y = 0 at the last
// knot, gives the highest y of every knot (as in time-optimal path parametrisation: Bobrow 1985).
#pragma once

#include <stdint.h>

#include "segment.h"

namespace gemelo {

constexpr uint32_t kFullCeiling = 1u << 26;  // y = 1 in Q26; chosen

// Accelerations may go beyond the limit by 1/16, so that a path that brakes at the limit can be slowed at all.
inline int64_t with_margin(int64_t acceleration) { return acceleration + acceleration / 16; }

class Ceiling {
  public:
    void begin(const DeviceConfig& config) {
        config_ = &config;
        dt_us_ = 0;
    }

    // The ceiling at `from`, when it is `next_q26` at `to`.
    uint32_t before(const Knot& from, const Knot& to, uint32_t next_q26) const;

  private:
    void set_dt(uint32_t dt_us) const;

    const DeviceConfig* config_ = nullptr;
    // Of the last dt, as most knots have the same.
    mutable uint32_t dt_us_ = 0;
    mutable int64_t swing_q8_[kMaxJoints];  // 2 dt A, Q8 steps/s
};

}  // namespace gemelo
