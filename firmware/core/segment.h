// The path between two knots: a cubic Hermite per joint, evaluated by Horner in fixed point.
#pragma once

#include <stdint.h>

#include "knot_queue.h"

namespace gemelo {

constexpr uint8_t kUnitBits = 24;  // the parameter u in [0, 1] is Q24; chosen
constexpr uint8_t kFineBits = 20;  // positions on the path are Q20 steps in 64 bits; chosen
constexpr int64_t kFineStep = 1ll << kFineBits;

// Steps from Q24.8 to Q20, exactly, and to the nearest Q24.8.
constexpr int64_t as_q20(int32_t q8) { return static_cast<int64_t>(q8) * (kFineStep / 256); }
constexpr int32_t as_q8(int64_t q20) { return static_cast<int32_t>((q20 + 2048) >> 12); }

// p(u) = origin + u (c1 + u (c2 + u c3)); u = 1 gives the second knot exactly.
struct Cubic {
    int64_t origin_q20;
    int64_t c1, c2, c3;  // Q20 steps

    int64_t at(uint32_t u_q24) const {
        const int64_t u = u_q24;
        int64_t value = c2 + ((c3 * u) >> kUnitBits);
        value = c1 + ((value * u) >> kUnitBits);
        return origin_q20 + ((value * u) >> kUnitBits);
    }
};

Cubic make_cubic(int32_t p0_q8, int32_t v0_q8, int32_t p1_q8, int32_t v1_q8, uint32_t dt_us);

// How a joint moves within a segment, for the limits of the time scale.
struct Drift {
    int32_t speed_q8;  // the larger |velocity| of the two ends
    int32_t gain_q8;   // change of |velocity| along the motion: positive speeds up, negative brakes
    bool reverses;     // brakes first, and then speeds up as much
};

Drift drift_between(int32_t v0_q8, int32_t v1_q8);

struct Segment {
    Cubic cubic[kMaxJoints];
    Drift drift[kMaxJoints];
    int64_t own_q16[kMaxJoints];  // change of |velocity| in a slot of the path, Q16 steps/s
    uint32_t dt_us = 0;
    uint64_t per_dt_q48 = 0;  // 1 / dt, rounded down: divisions are slow on the chip

    void load(const Knot& from, const Knot& to, uint8_t joints);
    // time 2^bits / dt, rounded down; of a time in 2^-15 us that is no longer than dt, and at most 24 bits.
    uint32_t share(uint64_t time, uint8_t bits) const;
};

}  // namespace gemelo
