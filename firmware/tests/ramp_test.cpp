// The ramp: on its target exactly, within speed and acceleration, whatever it is told on the way.
#include "ramp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "config.h"

using namespace gemelo;

namespace {

constexpr double kFine = 1048576.0;

// A ramp that is watched: the highest speed and acceleration of its slots, in steps/s and steps/s^2.
struct Watched {
    Ramp ramp;
    double fastest = 0, hardest = 0, v = 0;

    void advance(bool brakes = false) {
        const int64_t before = ramp.position_q20();
        ramp.advance(brakes);
        const double next = static_cast<double>(ramp.position_q20() - before) / kFine * 1000.0;
        fastest = std::max(fastest, std::fabs(next));
        hardest = std::max(hardest, std::fabs(next - v) * 1000.0);
        v = next;
    }
};

int64_t q20(double steps) { return static_cast<int64_t>(steps * 256) * 4096; }

}  // namespace

TEST(Ramp, EndsExactlyOnItsTargetWithinSpeedAndAcceleration) {
    std::mt19937 random(3);
    std::uniform_real_distribution<> place(-20000, 20000), speed(5, 30000), acceleration(100, 200000);
    for (int i = 0; i < 300; ++i) {
        Watched w;
        const double v = speed(random), a = acceleration(random), target = place(random);
        w.ramp.begin(q20(place(random)), static_cast<int32_t>(a * 256));
        w.ramp.set_speed(static_cast<int32_t>(v * 256));
        w.ramp.go(q20(target));
        for (int slot = 0; slot < 10000000 && !w.ramp.is_there(); ++slot) w.advance();
        ASSERT_EQ(w.ramp.position_q20(), q20(target));
        EXPECT_LE(w.fastest, v * 1.001 + 0.001);
        EXPECT_LE(w.hardest, a * 1.01 + 2.0) << "a position's rounding is a thousandth of a step/s";
    }
}

TEST(Ramp, TakesHardlyLongerThanTheIdealTrapezoid) {
    for (double distance : {1.0, 10.0, 500.0, 1000.0, 5000.0, 40000.0}) {
        Ramp ramp;
        ramp.begin(0, 8000 * 256);
        ramp.set_speed(4000 * 256);
        ramp.go(q20(distance));
        int slots = 0;
        for (; !ramp.is_there(); ++slots) ramp.advance(false);
        const double ideal = distance < 2000 ? 2 * std::sqrt(distance / 8000) : distance / 4000 + 0.5;
        EXPECT_NEAR(slots, ideal * 1000, 4) << distance;
    }
}

TEST(Ramp, NeverGoesBeyondATargetThatItCanStopAt) {
    for (double target : {0.5, 3.0, 777.0, -12345.0}) {
        Ramp ramp;
        ramp.begin(0, 8000 * 256);
        ramp.set_speed(4000 * 256);
        ramp.go(q20(target));
        for (int slot = 0; slot < 10000; ++slot) {
            ramp.advance(false);
            ASSERT_LE(std::llabs(ramp.position_q20()), std::llabs(q20(target)));
        }
    }
}

TEST(Ramp, StaysWithinItsAccelerationWhateverTargetAndSpeedItIsTold) {
    std::mt19937 random(5);
    std::uniform_real_distribution<> place(-3000, 3000), speed(0, 4000);
    Watched w;
    w.ramp.begin(0, 8000 * 256);
    w.ramp.set_speed(4000 * 256);
    for (int i = 0; i < 200000; ++i) {
        if (random() % 50 == 0) w.ramp.go(q20(place(random)));
        if (random() % 200 == 0) w.ramp.set_speed(static_cast<int32_t>(speed(random) * 256));
        w.advance(random() % 1000 < 100);
    }
    EXPECT_LE(w.fastest, 4000 * 1.001);
    EXPECT_LE(w.hardest, 8000 * 1.01);
    w.ramp.set_speed(4000 * 256);
    w.ramp.go(q20(-1.5));
    for (int i = 0; i < 10000; ++i) w.advance();
    EXPECT_TRUE(w.ramp.is_there());
}

TEST(Ramp, BrakesToRestAndGoesOnFromThere) {
    Watched w;
    w.ramp.begin(0, 8000 * 256);
    w.ramp.set_speed(4000 * 256);
    w.ramp.go(q20(9000));
    for (int i = 0; i < 900; ++i) w.advance();
    int slots = 0;
    for (; !w.ramp.is_still(); ++slots) w.advance(true);
    EXPECT_NEAR(slots, 500, 2);
    EXPECT_FALSE(w.ramp.is_there());
    for (int i = 0; i < 5000; ++i) w.advance();
    EXPECT_EQ(w.ramp.position_q20(), q20(9000));
    EXPECT_LE(w.hardest, 8000 * 1.01);
}

TEST(Ramp, StandsAtSpeedZeroAndGoesOnAfter) {
    Watched w;
    w.ramp.begin(0, 8000 * 256);
    w.ramp.set_speed(4000 * 256);
    w.ramp.go(q20(9000));
    for (int i = 0; i < 1000; ++i) w.advance();
    w.ramp.set_speed(0);
    for (int i = 0; i < 1000; ++i) w.advance();
    EXPECT_TRUE(w.ramp.is_still());
    EXPECT_FALSE(w.ramp.is_there());
    w.ramp.set_speed(1000 * 256);
    for (int i = 0; i < 20000; ++i) w.advance();
    EXPECT_TRUE(w.ramp.is_there());
    EXPECT_LE(w.hardest, 8000 * 1.01);
}
