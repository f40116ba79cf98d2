// The curve between two knots that are within the limits.
#include "bounds.h"

#include <gtest/gtest.h>

using namespace gemelo;

namespace {

constexpr JointLimits kLimits{-100 * 256, 100 * 256, 100000 * 256};

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
