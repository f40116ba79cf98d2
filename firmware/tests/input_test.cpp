// Filtering of the input pins: three equal readings for a switch, one for an e-stop.
#include <gtest/gtest.h>

#include <random>

#include "input_watch.h"
#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

// wired_joints(): pin 0 inverted, pin 4, pin 34 inverted, pin 35.
constexpr uint32_t kRestLow = 1u << 0, kRestHigh = 1u << 2;

struct Board {
    Board() { watch.begin(wired_joints()); }
    uint32_t read(uint32_t active) {
        Levels levels{kRestLow | 0xFFFFFF00u, kRestHigh};  // other pins are nobody's matter
        if (active & 1) levels.low ^= 1u << 0;
        if (active & 2) levels.low ^= 1u << 4;
        if (active & 4) levels.high ^= 1u << 2;
        if (active & 8) levels.high ^= 1u << 3;
        ++tick;
        return watch.differs(levels) ? watch.read(levels, tick) : 0;
    }
    InputWatch watch;
    uint32_t tick = UINT32_MAX - 5;  // it wraps on the way
};

}  // namespace

TEST(Inputs, OfASwitchCountAfterThreeEqualReadings) {
    for (uint32_t input : {2u, 4u, 8u}) {
        Board board;
        EXPECT_EQ(board.read(input), 0u);
        EXPECT_EQ(board.read(input), 0u);
        EXPECT_EQ(board.read(input), input);
        EXPECT_EQ(board.watch.active(), input);
        EXPECT_EQ(board.read(input), 0u) << "said once";
        board.read(0), board.read(0);
        EXPECT_EQ(board.watch.active(), input) << "released after three readings too";
        board.read(0);
        EXPECT_EQ(board.watch.active(), 0u);
    }
}

TEST(Inputs, DoNotCountGlitches) {
    Board board;
    for (int i = 0; i < 100; ++i) {
        EXPECT_EQ(board.read(2), 0u);
        EXPECT_EQ(board.read(2), 0u);
        EXPECT_EQ(board.read(0), 0u);
    }
    EXPECT_EQ(board.watch.active(), 0u);
}

TEST(Inputs, OfAnEStopCountAtOnceAndAreReleasedAfterThreeReadings) {
    Board board;
    EXPECT_EQ(board.read(1), 1u);
    EXPECT_EQ(board.watch.active(), 1u);
    board.read(0), board.read(1), board.read(0), board.read(0);
    EXPECT_EQ(board.watch.active(), 1u) << "a bouncing button is pressed";
    board.read(0);
    EXPECT_EQ(board.watch.active(), 0u);
}

TEST(Inputs, AreWhatTheLastThreeEqualReadingsSay) {
    std::mt19937 random(11);
    Board board;
    uint32_t expected = 0, last = 0, before = 0;
    for (int i = 0; i < 100000; ++i) {
        const uint32_t now = random() % 4 == 0 ? random() % 16 : last;
        board.read(now);
        const uint32_t agree = ~(now ^ last) & ~(last ^ before) & 0xF;
        expected = (expected & ~agree) | (now & agree);
        expected |= now & 1;
        ASSERT_EQ(board.watch.active(), expected) << i;
        before = last;
        last = now;
    }
}

TEST(Inputs, AreToldInTheState) {
    Wired wired;
    wired.press(kHome1, Finger::Pressed);
    wired.run_ms(30);
    EXPECT_EQ(load_u16(&wired.state[18]), 1u << kHome1);
    wired.press(kHome1, Finger::HeldOpen);
    wired.run_ms(30);
    EXPECT_EQ(load_u16(&wired.state[18]), 0u);
}
