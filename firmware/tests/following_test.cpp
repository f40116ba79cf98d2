// Text mode's motion: every joint to its newest target within its own limits.
#include <gtest/gtest.h>

#include <random>

#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

void expect_within_limits(const Wired& wired) {
    for (size_t j = 0; j < 2; ++j) {
        EXPECT_LE(wired.fastest(j), 4000 * 1.01);
        EXPECT_LE(wired.hardest(j), 8000 * 1.1);
    }
    EXPECT_LE(wired.machine.max_slot_error_q8(), 128u);
}

}  // namespace

TEST(Following, EndsExactlyOnTheLastTargetWhateverCameBefore) {
    std::mt19937 random(31);
    std::uniform_int_distribution<> place(-6000, 6000);
    Wired wired(open_field(), {0, 0}, true);
    for (int round = 0; round < 10; ++round) {
        for (int i = 0; i < 60; ++i) {
            ASSERT_EQ(wired.follow(place(random), place(random)), Code::Ok);
            wired.run_ms(1 + random() % 60);
        }
        const int32_t first = place(random), second = place(random);
        ASSERT_EQ(wired.follow(first, second), Code::Ok);
        ASSERT_TRUE(wired.run_until(Mode::Idle));
        EXPECT_EQ(wired.shaft[0], first);
        EXPECT_EQ(wired.shaft[1], second);
    }
    expect_within_limits(wired);
}

TEST(Following, RefusesATargetBeyondALimitAndMovesNothing) {
    Wired wired(open_field(), {0, 0}, true);
    EXPECT_EQ(wired.follow(50, 100001), Code::PositionLimit);
    EXPECT_EQ(wired.machine.mode(), Mode::Idle);
    wired.run_ms(100);
    EXPECT_EQ(wired.shaft[0], 0);
}

TEST(Following, AndAStreamDoNotMix) {
    Wired wired(open_field(), {0, 0}, true);
    ChunkSpec chunk;
    chunk.first = true;
    chunk.dt_us = 200000;
    chunk.rows = {Row{{0, 0}, {0, 0}}, Row{{2560, 0}, {0, 0}}};
    ASSERT_EQ(wired.follow(2000, 0), Code::Ok);
    wired.run_ms(100);
    EXPECT_EQ(wired.send(chunk), Code::NotReady);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    for (Row& row : chunk.rows) row.position[0] += 2000 * 256;
    chunk.last = true;
    ASSERT_EQ(wired.send(chunk), Code::Ok);
    wired.run_ms(5);
    EXPECT_EQ(wired.follow(0, 0), Code::NotReady);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.shaft[0], 2010);
    EXPECT_EQ(wired.follow(0, 0), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.shaft[0], 0);
}

TEST(Following, GoesToItsLastTargetThoughNoLineComesAnyMore) {
    Wired wired(open_field(), {0, 0}, true);
    ASSERT_EQ(wired.follow(9000, -9000), Code::Ok);
    wired.run_ms(10000, true);
    EXPECT_EQ(wired.machine.mode(), Mode::Idle);
    EXPECT_EQ(wired.shaft[0], 9000);
    EXPECT_EQ(wired.count_events("hold"), 0);
}

TEST(Following, IsHeldResumedAndStoppedWithinTheAccelerations) {
    Wired wired(open_field(), {0, 0}, true);
    ASSERT_EQ(wired.follow(9000, -4000), Code::Ok);
    wired.run_ms(700);
    EXPECT_EQ(wired.command(Command::Hold), Code::Ok);
    EXPECT_EQ(wired.follow(0, 0), Code::NotReady);
    wired.run_ms(1000);
    EXPECT_EQ(wired.machine.mode(), Mode::Hold);
    const int32_t stood = wired.shaft[0];
    wired.run_ms(1000);
    EXPECT_EQ(wired.shaft[0], stood);
    EXPECT_EQ(wired.command(Command::Resume), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.shaft[0], 9000);
    ASSERT_EQ(wired.follow(0, 0), Code::Ok);
    wired.run_ms(700);
    EXPECT_EQ(wired.command(Command::Stop), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle, 600));
    EXPECT_EQ(wired.count_events("stopped"), 1);
    EXPECT_GT(wired.shaft[0], 1000);
    expect_within_limits(wired);
}
