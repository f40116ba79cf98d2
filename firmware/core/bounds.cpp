#include "bounds.h"

namespace gemelo {
namespace {

// Knots are rounded to 1/256 step; what that does to the slope between two of them is not the sender's fault.
constexpr int64_t kRoundingQ8 = 4;
constexpr int64_t kMicro = 1000000;

int64_t magnitude(int64_t value) { return value < 0 ? -value : value; }

int32_t saturate(int64_t value) {
    if (value > INT32_MAX) return INT32_MAX;
    if (value < INT32_MIN) return INT32_MIN;
    return static_cast<int32_t>(value);
}

// The largest |velocity| times dt of the span, in Q8 steps times 1e6. The velocity is a quadratic with
// Bezier ordinates m0, c, m1; it leaves them only where c lies outside [m0, m1].
int64_t peak_velocity(int64_t m0, int64_t c, int64_t m1, int64_t limit) {
    const int64_t size = magnitude(c);
    if (size <= limit) return 0;
    if (size > 4 * limit) return size / 2;
    // Three significant values of 30 bits each, so that their products fit.
    uint8_t shift = 0;
    while ((size >> shift) >= (1 << 30)) ++shift;
    const int64_t a = m0 >> shift, b = c >> shift, d = m1 >> shift;
    const int64_t curvature = a + d - 2 * b;
    const bool is_between = (a <= b) == (b <= d);
    if (curvature == 0 || is_between) return 0;
    return magnitude((a * d - b * b) / curvature) << shift;
}

// The four Bezier ordinates of a cubic; it stays within their hull. All in Q16 steps.
struct Hull {
    int64_t b[4];
};

// de Casteljau at the middle: each half lies closer to the curve. Leaves the right one.
Hull split_left(Hull* hull) {
    Hull left;
    for (int round = 0; round < 4; ++round) {
        left.b[round] = hull->b[0];
        for (int i = 0; i + round < 3; ++i) hull->b[i] = (hull->b[i] + hull->b[i + 1]) / 2;
    }
    return left;
}

Verdict check_hull(Hull hull, const JointLimits& limits, uint8_t depth) {
    const int64_t tolerance = 256;
    int64_t highest = hull.b[0], lowest = hull.b[0];
    for (int64_t b : hull.b) {
        if (b > highest) highest = b;
        if (b < lowest) lowest = b;
    }
    const bool above = highest > static_cast<int64_t>(limits.upper_q8) * 256 + tolerance;
    const bool below = lowest < static_cast<int64_t>(limits.lower_q8) * 256 - tolerance;
    if (!above && !below) return Verdict{};
    if (depth == 0)
        return Verdict{Code::PositionLimit, kNoJoint, 0, saturate((above ? highest : lowest) / 256),
                       above ? limits.upper_q8 : limits.lower_q8};
    const Hull left = split_left(&hull);
    const Verdict verdict = check_hull(left, limits, static_cast<uint8_t>(depth - 1));
    return verdict.is_ok() ? check_hull(hull, limits, static_cast<uint8_t>(depth - 1)) : verdict;
}

// The hull's ordinate beside an end, which lies m / 3 from it, is within the limits.
bool keeps_near(int64_t p_q8, int64_t m, const JointLimits& limits) {
    const int64_t room_q8 = m > 0 ? limits.upper_q8 - p_q8 : p_q8 - limits.lower_q8;
    return magnitude(m) <= 3 * kMicro * room_q8;
}

}  // namespace

// The path may accelerate by a quarter more than the limit, because a cubic bends a little more than the smooth path
// that was sampled, and by what rounded knots make of it. An acceleration is cut off to whole Q8 steps/s in a dt, and
// to whole Q8 steps/s^2: so far these bounds go.
SpanBounds bounds_of(const JointLimits& limits, uint32_t dt_us) {
    const int64_t dt = dt_us, limit_q8 = limits.acceleration_q8;
    const int64_t allowed_q8 = limit_q8 + limit_q8 / 4 + 6 * kMicro * kMicro / (dt * dt) + 4 * kMicro / dt;
    const int64_t change_q8 = ((allowed_q8 + 1) * dt + kMicro - 1) / kMicro;  // in a dt, the least that is too much
    return SpanBounds{limits.velocity_q8 * dt + kRoundingQ8 * kMicro, (change_q8 * dt - 1) / 2};
}

// With the velocity a quadratic of ordinates m0, c, m1 (times dt), the acceleration is linear from 2 (c - m0) to 2 (m1
// - c) (times dt^2), so one of its ends is the largest.
Verdict check_span(const Span& span, const JointLimits& limits, const SpanBounds& bounds) {
    const int64_t dt = span.dt_us, m0 = span.v0_q8 * dt, m1 = span.v1_q8 * dt;
    const int64_t c = 3 * kMicro * (static_cast<int64_t>(span.p1_q8) - span.p0_q8) - m0 - m1;
    const int64_t peak = peak_velocity(m0, c, m1, bounds.velocity);
    if (peak > bounds.velocity)
        return Verdict{Code::VelocityLimit, kNoJoint, 0, saturate(peak / dt), limits.velocity_q8};
    const int64_t begin = magnitude(c - m0), end = magnitude(m1 - c), bend = begin > end ? begin : end;
    if (bend > bounds.acceleration)
        return Verdict{Code::AccelerationLimit, kNoJoint, 0, saturate(2 * bend / dt * kMicro / dt),
                       limits.acceleration_q8};
    if (keeps_near(span.p0_q8, m0, limits) && keeps_near(span.p1_q8, -m1, limits)) return Verdict{};
    const int64_t p0 = static_cast<int64_t>(span.p0_q8) * 256, p1 = static_cast<int64_t>(span.p1_q8) * 256;
    return check_hull(Hull{{p0, p0 + m0 * 256 / (3 * kMicro), p1 - m1 * 256 / (3 * kMicro), p1}}, limits, 4);
}

}  // namespace gemelo
