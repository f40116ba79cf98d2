// Checks that the path between two knots, which are within a joint's limits, stays within them.
#pragma once

#include <stdint.h>

#include "protocol.h"

namespace gemelo {

struct JointLimits {
    int32_t lower_q8;
    int32_t upper_q8;
    int32_t velocity_q8;
    int32_t acceleration_q8;
};

struct Span {
    int32_t p0_q8, v0_q8, p1_q8, v1_q8;
    uint32_t dt_us;
};

// What a joint's limits leave of a span of one dt, times powers of dt: nothing is divided to keep to them.
struct SpanBounds {
    int64_t velocity;      // times dt
    int64_t acceleration;  // times dt^2 / 2
};

SpanBounds bounds_of(const JointLimits& limits, uint32_t dt_us);

// Fills code, value and limit; joint and knot are the caller's. `bounds` are of the same limits and dt.
Verdict check_span(const Span& span, const JointLimits& limits, const SpanBounds& bounds);

}  // namespace gemelo
