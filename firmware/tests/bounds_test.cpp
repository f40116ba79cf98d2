// The curve between two knots that are within the limits.
#include "bounds.h"

#include <gtest/gtest.h>

using namespace gemelo;

namespace {

constexpr JointLimits kLimits{-100 * 256, 100 * 256, 100000 * 256, 1 << 30};

Verdict check_span(const Span& span, const JointLimits& limits) {
    return gemelo::check_span(span, limits, bounds_of(limits, span.dt_us));
}

}  // namespace

TEST(Bounds, ACurveThatSwingsBeyondALimitBetweenGoodKnotsIsRefusedWithTheLimitThatItMeets) {
    const Verdict above = check_span(Span{99 * 256, 2000 * 256, 99 * 256, -2000 * 256, 20000}, kLimits);
    EXPECT_EQ(above.code, Code::PositionLimit);
    EXPECT_EQ(above.limit, kLimits.upper_q8);
    EXPECT_GT(above.value, kLimits.upper_q8);
    const Verdict below = check_span(Span{-99 * 256, -2000 * 256, -99 * 256, 2000 * 256, 20000}, kLimits);
    EXPECT_EQ(below.code, Code::PositionLimit);
    EXPECT_EQ(below.limit, kLimits.lower_q8);
    EXPECT_LT(below.value, kLimits.lower_q8);
    EXPECT_TRUE(check_span(Span{-99 * 256, -100 * 256, -99 * 256, 100 * 256, 20000}, kLimits).is_ok());
}

TEST(Bounds, ACurveThatBendsMoreThanTheJointCanIsRefusedWithItsAcceleration) {
    constexpr JointLimits kSlow{-100 * 256, 100 * 256, 100000 * 256, 1000 * 256};
    // From rest to rest: 6 d / dt^2 at both ends.
    const Verdict verdict = check_span(Span{0, 0, 10 * 256, 0, 100000}, kSlow);
    EXPECT_EQ(verdict.code, Code::AccelerationLimit);
    EXPECT_EQ(verdict.value, 6000 * 256);
    EXPECT_EQ(verdict.limit, 1000 * 256);
    EXPECT_TRUE(check_span(Span{0, 0, 2 * 256, 0, 100000}, kSlow).is_ok()) << "1200 steps/s^2 are within a quarter";
    EXPECT_FALSE(check_span(Span{0, 0, 10 * 256, 0, 150000}, kSlow).is_ok());
    // A step of velocity within one span, and constant acceleration at the limit.
    EXPECT_EQ(check_span(Span{0, 0, 13, 256 * 100, 1000}, kSlow).code, Code::AccelerationLimit);
    EXPECT_TRUE(check_span(Span{0, 0, 5 * 256, 100 * 256, 100000}, kSlow).is_ok());
}

TEST(Bounds, KnotsThatAreOnlyRoundedDoNotBend) {
    constexpr JointLimits kSlow{-100 * 256, 100 * 256, 100000 * 256, 1};
    for (uint32_t dt_us : {1000u, 5000u, 20000u, 250000u})
        for (int32_t off : {-1, 0, 1})
            EXPECT_TRUE(check_span(Span{0, 0, off, 0, dt_us}, kSlow).is_ok()) << dt_us << " us, " << off;
}
