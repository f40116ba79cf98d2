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
    if (magnitude(c) <= limit) return 0;
    if (magnitude(c) > 4 * limit) return magnitude(c) / 2;
    // Three significant values of 30 bits each, so that their products fit.
    uint8_t shift = 0;
    while ((magnitude(c) >> shift) >= (1 << 30)) ++shift;
    const int64_t a = m0 >> shift, b = c >> shift, d = m1 >> shift;
    const int64_t curvature = a + d - 2 * b;
    const bool is_between = (a <= b) == (b <= d);
    if (curvature == 0 || is_between) return 0;
    return magnitude((a * d - b * b) / curvature) << shift;
}

Verdict check_velocity(const Span& span, int32_t limit_q8) {
    const int64_t dt = span.dt_us;
    const int64_t m0 = span.v0_q8 * dt, m1 = span.v1_q8 * dt;
    const int64_t c = 3 * kMicro * (static_cast<int64_t>(span.p1_q8) - span.p0_q8) - m0 - m1;
    const int64_t limit = limit_q8 * dt + kRoundingQ8 * kMicro;
    const int64_t peak = peak_velocity(m0, c, m1, limit);
    if (peak <= limit) return Verdict{};
    return Verdict{Code::VelocityLimit, kNoJoint, 0, saturate(peak / dt), limit_q8};
}

// The acceleration is linear between two knots, so one of its ends is the largest. A quarter more than the limit is for
// the cubic, which bends a little more than the smooth path that was sampled; the rest is what rounded knots make of
// it.
Verdict check_acceleration(const Span& span, int32_t limit_q8) {
    const int64_t dt = span.dt_us;
    const int64_t slope = 6 * kMicro * (static_cast<int64_t>(span.p1_q8) - span.p0_q8) / dt;
    const int64_t first = slope - 4 * static_cast<int64_t>(span.v0_q8) - 2 * static_cast<int64_t>(span.v1_q8);
    const int64_t last = -slope + 2 * static_cast<int64_t>(span.v0_q8) + 4 * static_cast<int64_t>(span.v1_q8);
    const int64_t peak = (magnitude(first) > magnitude(last) ? magnitude(first) : magnitude(last)) * kMicro / dt;
    const int64_t rounding = 6 * kMicro * kMicro / (dt * dt) + 4 * kMicro / dt;
    if (peak <= limit_q8 + static_cast<int64_t>(limit_q8) / 4 + rounding) return Verdict{};
    return Verdict{Code::AccelerationLimit, kNoJoint, 0, saturate(peak), limit_q8};
}

// The four Bezier ordinates of a cubic; it stays within their hull. All in Q16 steps.
struct Hull {
    int64_t b0, b1, b2, b3;

    int64_t highest() const {
        const int64_t x = b0 > b1 ? b0 : b1, y = b2 > b3 ? b2 : b3;
        return x > y ? x : y;
    }
    int64_t lowest() const {
        const int64_t x = b0 < b1 ? b0 : b1, y = b2 < b3 ? b2 : b3;
        return x < y ? x : y;
    }
};

// de Casteljau at the middle: each half lies closer to the curve.
void split(const Hull& hull, Hull* left, Hull* right) {
    const int64_t b01 = (hull.b0 + hull.b1) / 2, b12 = (hull.b1 + hull.b2) / 2, b23 = (hull.b2 + hull.b3) / 2;
    const int64_t b012 = (b01 + b12) / 2, b123 = (b12 + b23) / 2, middle = (b012 + b123) / 2;
    *left = Hull{hull.b0, b01, b012, middle};
    *right = Hull{middle, b123, b23, hull.b3};
}

Verdict check_hull(const Hull& hull, const JointLimits& limits, uint8_t depth) {
    const int64_t tolerance = 256;
    const int64_t upper = static_cast<int64_t>(limits.upper_q8) * 256,
                  lower = static_cast<int64_t>(limits.lower_q8) * 256;
    const bool above = hull.highest() > upper + tolerance, below = hull.lowest() < lower - tolerance;
    if (!above && !below) return Verdict{};
    if (depth == 0) {
        if (above) return Verdict{Code::PositionLimit, kNoJoint, 0, saturate(hull.highest() / 256), limits.upper_q8};
        return Verdict{Code::PositionLimit, kNoJoint, 0, saturate(hull.lowest() / 256), limits.lower_q8};
    }
    Hull left, right;
    split(hull, &left, &right);
    const Verdict verdict = check_hull(left, limits, static_cast<uint8_t>(depth - 1));
    return verdict.is_ok() ? check_hull(right, limits, static_cast<uint8_t>(depth - 1)) : verdict;
}

Verdict check_position(const Span& span, const JointLimits& limits) {
    const int64_t dt = span.dt_us;
    const int64_t p0 = static_cast<int64_t>(span.p0_q8) * 256, p1 = static_cast<int64_t>(span.p1_q8) * 256;
    const Hull hull{p0, p0 + span.v0_q8 * dt * 256 / (3 * kMicro), p1 - span.v1_q8 * dt * 256 / (3 * kMicro), p1};
    return check_hull(hull, limits, 4);
}

}  // namespace

Verdict check_span(const Span& span, const JointLimits& limits) {
    Verdict verdict = check_velocity(span, limits.velocity_q8);
    if (verdict.is_ok()) verdict = check_acceleration(span, limits.acceleration_q8);
    return verdict.is_ok() ? check_position(span, limits) : verdict;
}

}  // namespace gemelo
