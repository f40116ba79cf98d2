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

// Fills code, value and limit; joint and knot are the caller's.
Verdict check_span(const Span& span, const JointLimits& limits);

}  // namespace gemelo
