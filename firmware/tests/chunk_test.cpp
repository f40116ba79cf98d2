// Chunks: in order, once, all or nothing, and refused with the reason.
#include <gtest/gtest.h>

#include "bytes.h"
#include "motion.h"

using namespace gemelo;
using namespace rig;

namespace {

const Motion kMotion = quintic({0, 0}, {500, -300});

}  // namespace

TEST(Chunk, IsPlayedToItsLastStep) {
    Rig rig;
    const Ack ack = rig.send(kMotion.whole());
    EXPECT_EQ(ack.code, Code::Ok);
    EXPECT_EQ(ack.next_seq, 1u);
    EXPECT_EQ(ack.credits, 128 - (kMotion.knots() - 1));
    EXPECT_EQ(rig.mode(), Mode::Run);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(0), 500);
    EXPECT_EQ(rig.steps(1), -300);
    EXPECT_EQ(rig.count_events("started"), 1);
    EXPECT_EQ(rig.count_events("finished"), 1);
    EXPECT_EQ(rig.state().play_us, (kMotion.knots() - 1) * 20000);
    EXPECT_EQ(rig.state().underruns, 0u);
}

TEST(Chunk, ThatIsRepeatedIsIgnoredAndCountsAsAccepted) {
    Rig rig;
    const ChunkSpec first = kMotion.chunk(0, 10, 0), second = kMotion.chunk(10, kMotion.knots(), 1);
    EXPECT_EQ(rig.send(first).code, Code::Ok);
    const Ack again = rig.send(first);
    EXPECT_EQ(again.code, Code::Duplicate);
    EXPECT_EQ(again.next_seq, 1u);
    EXPECT_EQ(again.credits, 128 - 9);
    EXPECT_EQ(rig.send(second).code, Code::Ok);
    EXPECT_EQ(rig.send(first).code, Code::Duplicate);
    rig.run_until_idle();
    EXPECT_EQ(rig.send(second).code, Code::Duplicate);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 500);
    EXPECT_EQ(rig.state().refused, 0u);
}

TEST(Chunk, ThatFollowsAMissingOneIsRefusedWithTheOneThatIsWanted) {
    Rig rig;
    rig.send(kMotion.chunk(0, 10, 0));
    const Ack gap = rig.send(kMotion.chunk(20, 30, 2));
    EXPECT_EQ(gap.code, Code::Gap);
    EXPECT_EQ(gap.next_seq, 1u);
    EXPECT_EQ(gap.limit, 1);
    EXPECT_EQ(rig.send(kMotion.chunk(10, 20, 1)).code, Code::Ok);
    EXPECT_EQ(rig.send(kMotion.chunk(20, kMotion.knots(), 2)).code, Code::Ok);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(1), -300);
}

TEST(Chunk, IsTakenWholeOrNotAtAll) {
    Rig rig;
    ChunkSpec chunk = kMotion.whole();
    chunk.rows[20].velocity[1] = 4001 * 256;
    const Ack ack = rig.send(chunk);
    EXPECT_EQ(ack.code, Code::VelocityLimit);
    EXPECT_EQ(ack.joint, 1);
    EXPECT_EQ(ack.knot, 20);
    EXPECT_EQ(ack.value, 4001 * 256);
    EXPECT_EQ(ack.limit, 4000 * 256);
    EXPECT_EQ(ack.credits, 128);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    rig.run_ms(100);
    EXPECT_EQ(rig.steps(0), 0);
}

TEST(Chunk, WithMoreKnotsThanCreditsIsRefusedUntilThereIsSpace) {
    Rig rig;
    const Motion motion = quintic({0, 0}, {9000, 0});
    ASSERT_GT(motion.knots(), 150u);
    EXPECT_EQ(rig.send(motion.chunk(0, 120, 0)).code, Code::Ok);
    const Ack full = rig.send(motion.chunk(120, 140, 1));
    EXPECT_EQ(full.code, Code::NoSpace);
    EXPECT_EQ(full.value, 20);
    EXPECT_EQ(full.limit, 9);
    EXPECT_EQ(full.credits, 9);
    EXPECT_EQ(full.next_seq, 1u);
    rig.run_ms(300);
    EXPECT_EQ(rig.send(motion.chunk(120, 140, 1)).code, Code::Ok);
}

TEST(Chunk, OfAStaleLifeOrTimeMovesNothing) {
    Rig rig;
    rig.run_ms(10);
    ChunkSpec chunk = kMotion.whole();
    chunk.boot_id = kBoot + 1;
    EXPECT_EQ(rig.send(chunk).code, Code::WrongBoot);
    chunk.boot_id = kBoot;
    chunk.expires_us = rig.device.now_us() - 1;
    EXPECT_EQ(rig.send(chunk).code, Code::Expired);
    chunk.expires_us = kNever;
    EXPECT_EQ(rig.send(chunk, true).code, Code::Retained);
    rig.run_ms(100);
    EXPECT_EQ(rig.steps(0), 0);
    EXPECT_EQ(rig.state().refused, 3u);
    EXPECT_EQ(rig.mode(), Mode::Idle);
}

TEST(Chunk, OfAnotherStreamWaitsForTheEndOfThisOne) {
    Rig rig;
    rig.send(kMotion.chunk(0, 10, 0, 7));
    const Ack busy = rig.send(kMotion.whole(8));
    EXPECT_EQ(busy.code, Code::NotReady);
    EXPECT_EQ(busy.value, static_cast<int>(Mode::Run));
    EXPECT_EQ(rig.send(kMotion.chunk(10, 20, 1, 8)).code, Code::WrongStream);
    rig.send(kMotion.chunk(10, kMotion.knots(), 1, 7));
    EXPECT_EQ(rig.send(kMotion.chunk(10, 20, 2, 7)).code, Code::WrongStream) << "the stream has its last knot";
    rig.run_until_idle();
    EXPECT_EQ(rig.send(quintic({500, -300}, {0, 0}).whole(8)).code, Code::Ok);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(0), 0);
    EXPECT_EQ(rig.send(kMotion.whole(7)).code, Code::WrongStream) << "a stream is played once";
}

TEST(Chunk, OfAnUnreferencedDeviceIsRefused) {
    Rig rig(two_joints(), false);
    const Ack ack = rig.send(kMotion.whole());
    EXPECT_EQ(ack.code, Code::NotReady);
    EXPECT_EQ(ack.value, static_cast<int>(Mode::Unreferenced));
    EXPECT_EQ(rig.command(Command::Reference, {256 * 40, 128}), Code::Ok);
    EXPECT_EQ(rig.steps(0), 40);
    EXPECT_EQ(rig.steps(1), 1);
    EXPECT_EQ(rig.send(quintic({40, 0.5}, {50, 0}).whole()).code, Code::Ok);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(0), 50);
    EXPECT_EQ(rig.steps(1), 0);
}

TEST(Chunk, MayOvershootNoSoftLimitBetweenItsKnots) {
    DeviceConfig config = two_joints();
    config.joint[0].upper_q8 = 100 * 256;
    config.joint[0].max_acceleration_q8 = 1 << 30;
    Rig rig(config);
    ChunkSpec chunk;
    chunk.first = chunk.last = true;
    chunk.dt_us = 100000;
    // Both knots within 100 steps, but at 500 steps/s into the turn the path swings out to about 107.
    chunk.rows = {Row{{0, 0}, {0, 0}},
                  Row{{50 * 256, 0}, {500 * 256, 0}},
                  Row{{95 * 256, 0}, {500 * 256, 0}},
                  Row{{95 * 256, 0}, {-500 * 256, 0}},
                  Row{{50 * 256, 0}, {-500 * 256, 0}},
                  Row{{0, 0}, {0, 0}}};
    const Ack ack = rig.send(chunk);
    EXPECT_EQ(ack.code, Code::PositionLimit);
    EXPECT_EQ(ack.joint, 0);
    EXPECT_EQ(ack.knot, 3);
    EXPECT_EQ(ack.limit, 100 * 256);
    EXPECT_GT(ack.value, 100 * 256);
    EXPECT_LE(ack.value, 108 * 256);
    chunk.rows[2].position[0] = chunk.rows[3].position[0] = 86 * 256;
    EXPECT_EQ(rig.send(chunk).code, Code::Ok);
}

TEST(Chunk, ThatFollowsTheEndAtOnceStartsItsOwnStream) {
    Rig rig;
    rig.send(kMotion.whole(7));
    while (rig.mode() != Mode::Idle) rig.run_ms(1);
    const Motion back = quintic({500, -300}, {0, 0});
    ASSERT_EQ(rig.send(back.whole(8)).code, Code::Ok);
    EXPECT_EQ(rig.device.machine().present().play_us, 0u);
    rig.run_ms(static_cast<uint32_t>(back.duration() * 500));
    EXPECT_EQ(rig.mode(), Mode::Run);
    EXPECT_EQ(rig.count_events("finished"), 1);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(0), 0);
}

TEST(Chunk, OfOneRestingKnotEndsAtOnce) {
    Rig rig;
    ChunkSpec chunk;
    chunk.first = chunk.last = true;
    chunk.rows = {Row{{0, 0}, {0, 0}}};
    EXPECT_EQ(rig.send(chunk).code, Code::Ok);
    rig.run_ms(10);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.count_events("finished"), 1);
    EXPECT_EQ(rig.count_events("started"), 0);
}

TEST(Chunk, MayChangeItsSpacingWithinAStream) {
    Rig rig;
    const Motion coarse = quintic({0, 0}, {800, 0}, 0.020);
    const Motion fine{coarse.joints, 0.005};
    ASSERT_EQ(rig.send(coarse.chunk(0, 11, 0)).code, Code::Ok);
    ChunkSpec rest = fine.chunk(41, fine.knots(), 1);
    while (rest.rows.size() > 100) rest.rows.pop_back();
    rest.last = false;
    ASSERT_EQ(rig.send(rest).code, Code::Ok);
    rig.run_ms(202);
    for (int i = 0; i < 100; ++i) {
        rig.run_ms(1);
        const double t = static_cast<double>(rig.device.machine().present().play_us) * 1e-6;
        EXPECT_NEAR(rig.path(0), coarse.joints[0].position(t), 0.02);
    }
}

TEST(Clock, MayWrapAt32Bits) {
    Rig rig(two_joints(), true, (1ull << 32) - 500000);
    const Motion motion = quintic({0, 0}, {1500, 700});
    ChunkSpec chunk = motion.whole();
    chunk.expires_us = (1ull << 32) - 400000;
    ASSERT_EQ(rig.send(chunk).code, Code::Ok);
    rig.run_until_idle();
    EXPECT_GT(rig.device.now_us(), 1ull << 32);
    EXPECT_EQ(rig.steps(0), 1500);
    EXPECT_EQ(rig.state().underruns, 0u);
    EXPECT_GT(rig.state().t_us, 1ull << 32);
}

TEST(State, TellsNoVelocityForTheStepBetweenTheArmAndAStreamsFirstKnot) {
    DeviceConfig config = two_joints();
    config.state_hz = 1000;
    Rig rig(config);
    ChunkSpec chunk = quintic({0, 0}, {300, 0}).whole();
    for (Row& row : chunk.rows) row.position[1] += 121;  // 0.47 steps from where q2 stands
    ASSERT_EQ(rig.send(chunk).code, Code::Ok);
    rig.device.advance(rig.device.now_us() + 20000);
    int states = 0;
    for (const OutFrame& frame : rig.device.outputs()) {
        if (frame.output != Output::State) continue;
        ++states;
        EXPECT_EQ(load_i32(frame.payload.data() + 60 + 4 * 3), 0) << "state " << states;
    }
    EXPECT_GE(states, 19);
}
