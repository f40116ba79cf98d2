// Nonsense on the wire: with and without a valid CRC, it moves nothing that it may not and breaks nothing.
#include <gtest/gtest.h>

#include <random>

#include "bytes.h"
#include "motion.h"

using namespace gemelo;
using namespace rig;

namespace {

// Changes a few bytes after the magic and version, and perhaps the length; the CRC is right again in the end.
Bytes mutate(Bytes frame, std::mt19937& random) {
    frame.resize(frame.size() - 4);
    const auto below = [&random](size_t bound) { return static_cast<size_t>(random() % bound); };
    if (below(4) == 0) frame.resize(8 + below(frame.size()));
    if (below(8) == 0) frame.resize(frame.size() + below(64), static_cast<uint8_t>(random()));
    for (size_t i = below(4); i > 0; --i) frame[2 + below(frame.size() - 2)] = static_cast<uint8_t>(random());
    if (below(2) == 0 && frame.size() > 24) store_u32(&frame[8 + 4 * below((frame.size() - 12) / 4)], random());
    return seal(frame);
}

}  // namespace

TEST(Fuzz, OfRandomBytesIsCountedAndNotAnswered) {
    Rig rig;
    std::mt19937 random(1);
    for (int i = 0; i < 20000; ++i) {
        Bytes bytes(random() % 200);
        for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random());
        rig.device.receive(bytes);
    }
    EXPECT_TRUE(rig.device.outputs().empty());
    EXPECT_EQ(rig.state().bad_frames, 20000u);
}

TEST(Fuzz, OfFramesWithAValidCrcNeverLeavesTheLimitsOrLosesAStep) {
    std::mt19937 random(2);
    for (int round = 0; round < 40; ++round) {
        Rig rig;
        const Motion motion = quintic({0, 0}, {1000, -500});
        std::vector<Bytes> seeds = {build(motion.chunk(0, 20, 0)), build(motion.chunk(20, 40, 1)),
                                    build_heartbeat(1, 1), build_sync(1)};
        for (uint8_t cmd = 1; cmd <= 4; ++cmd) seeds.push_back(build_command(static_cast<Command>(cmd), cmd));
        seeds.push_back(build_command(Command::Reference, 9, {0, 0}));
        for (int i = 0; i < 500; ++i) {
            const Bytes& seed = seeds[random() % seeds.size()];
            rig.device.receive(random() % 10 == 0 ? seed : mutate(seed, random));
            if (i % 5 == 0) rig.run_ms(1 + random() % 20);
            ASSERT_LE(rig.device.machine().max_slot_error_q8(), 128u);
            ASSERT_LE(std::abs(rig.steps(0)), 100000);
            ASSERT_LE(std::abs(rig.steps(1)), 100000);
            ASSERT_NE(rig.mode(), Mode::Fault);
        }
    }
}
