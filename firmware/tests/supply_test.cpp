// The figures that a gateway steers its lead by: path left to play, and knots that still fit.
#include <gtest/gtest.h>

#include "motion.h"

using namespace gemelo;
using namespace rig;

TEST(Acknowledgement, TellsHowMuchOfThePathIsLeftToPlay) {
    const Motion motion = quintic({0, 0}, {3000, 0});
    Rig rig;
    Ack ack = rig.send(motion.chunk(0, 21, 0));
    EXPECT_EQ(ack.buffered_ms, 400) << "the FIRST knot stands at stream time 0";
    EXPECT_EQ(ack.credits, 128 - 20);
    ack = rig.send(motion.chunk(21, 31, 1));
    EXPECT_EQ(ack.buffered_ms, 600);
    rig.run_ms(102);
    const uint64_t played_ms = rig.device.machine().present().play_us / 1000;
    ack = rig.send(motion.chunk(31, 41, 2));
    EXPECT_NEAR(ack.buffered_ms + static_cast<double>(played_ms), 800, 2.0) << "the slots under way count as played";
    EXPECT_EQ(ack.credits, 128 - 35);
}
