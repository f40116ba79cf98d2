// Pulses as a driver sees them: widths, DIR set-up, direction.
#include <gtest/gtest.h>

#include <map>

#include "motion.h"

using namespace gemelo;
using namespace rig;

namespace {

// Checks the trace against a driver's demands and counts the steps it makes.
struct Scope {
    uint32_t setup_ticks = 1;
    std::map<int, int64_t> last_rise, last_turn, count;
    Pins before;

    void see(const PinChange& change, uint8_t joints, uint32_t inverted) {
        for (uint8_t j = 0; j < joints; ++j) {
            const uint32_t bit = 1u << j;
            const int64_t tick = static_cast<int64_t>(change.tick);
            if ((change.pins.dir ^ before.dir) & bit) last_turn[j] = tick;
            if (!((change.pins.step ^ before.step) & bit)) continue;
            const bool rises = (change.pins.step & bit) != 0;
            if (!rises) {
                EXPECT_EQ(tick - last_rise[j], 1) << "STEP is high for one tick";
                continue;
            }
            if (last_rise.count(j)) {
                EXPECT_GE(tick - last_rise[j], 2) << "and low for at least one";
            }
            last_rise[j] = tick;
            if (last_turn.count(j)) {
                EXPECT_GE(tick - last_turn[j], setup_ticks) << "DIR not still for long enough";
            }
            const bool forward = ((change.pins.dir ^ inverted) & bit) != 0;
            count[j] += forward ? 1 : -1;
        }
        before = change.pins;
    }
};

Scope play(Rig& rig, const Motion& motion, uint32_t setup_ticks) {
    Scope scope;
    scope.setup_ticks = setup_ticks;
    scope.before = rig.device.machine().stepper().pins();
    rig.device.set_tracing(true);
    Feeder feeder(motion, 7);
    while (!feeder.is_done() || rig.mode() != Mode::Idle) {
        feeder.feed(rig);
        rig.run_ms(10);
    }
    for (const PinChange& change : rig.device.trace()) scope.see(change, 2, 2);
    return scope;
}

}  // namespace

TEST(Pulses, AreAsManyAsTheMoveHasStepsInTheRightDirection) {
    Rig rig;
    const Scope scope = play(rig, quintic({0, 0}, {3000, -1234}), 1);
    EXPECT_EQ(scope.count.at(0), 3000);
    EXPECT_EQ(scope.count.at(1), -1234);
    EXPECT_EQ(rig.steps(0), 3000);
    EXPECT_EQ(rig.steps(1), -1234);
}

TEST(Pulses, NeverComeBeforeDirHasBeenStillForItsSetUpTime) {
    for (uint32_t setup_us : {0u, 5u, 20u, 21u, 100u}) {
        DeviceConfig config = two_joints();
        config.joint[0].dir_setup_us = config.joint[1].dir_setup_us = setup_us;
        config.joint[0].max_acceleration_q8 = config.joint[1].max_acceleration_q8 = 1 << 30;
        Rig rig(config);
        // There and back within one stream: the direction turns at full swing of both joints.
        ChunkSpec chunk;
        chunk.first = chunk.last = true;
        for (int i = 0; i <= 60; ++i) {
            const int32_t v = i == 0 || i == 60 ? 0 : (i / 10 % 2 ? -512000 : 512000);
            const int32_t p = 5120 + 1024 * (i % 20 < 10 ? i % 20 : 20 - i % 20) * 10;
            chunk.rows.push_back(Row{{i == 0 ? 0 : p / 8, i == 0 ? 0 : -p / 8}, {v / 8, -v / 8}});
        }
        Scope scope;
        scope.setup_ticks = setup_us <= 20 ? 1 : (setup_us + 19) / 20;
        scope.before = rig.device.machine().stepper().pins();
        rig.device.set_tracing(true);
        ASSERT_EQ(rig.send(chunk).code, Code::Ok);
        rig.run_until_idle();
        for (const PinChange& change : rig.device.trace()) scope.see(change, 2, 2);
        EXPECT_EQ(scope.count[0], rig.steps(0));
        EXPECT_EQ(scope.count[1], rig.steps(1));
        EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
    }
}

TEST(Pulses, ComeAtHalfTheTickRateAtMost) {
    DeviceConfig config = two_joints();
    config.joint[0].max_velocity_q8 = config.joint[1].max_velocity_q8 = 100000 * 256;
    config.joint[0].max_acceleration_q8 = config.joint[1].max_acceleration_q8 = 1000000 * 256;
    Rig rig(config);
    ChunkSpec chunk;
    chunk.first = chunk.last = true;
    const int32_t v = 25000 * 256;
    for (int i = 0; i <= 50; ++i) {
        const bool is_end = i == 0 || i == 50;
        const int32_t p = i == 0 ? 0 : (i == 50 ? 49 * 500 : i * 500 - 250) * 256;
        chunk.rows.push_back(Row{{p, -p}, {is_end ? 0 : v, is_end ? 0 : -v}});
    }
    ASSERT_EQ(rig.send(chunk).code, Code::Ok);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(0), 24500);
    EXPECT_EQ(rig.steps(1), -24500);
    EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
    chunk.stream = 8;
    chunk.rows[1].velocity[0] = v + 1;
    for (Row& row : chunk.rows) row.position[0] += 24500 * 256, row.position[1] -= 24500 * 256;
    EXPECT_EQ(rig.send(chunk).code, Code::VelocityLimit);
}

TEST(Pulses, AreTheSameAtEveryTickRate) {
    for (uint32_t tick_hz : {20000u, 50000u, 80000u, 100000u}) {
        DeviceConfig config = two_joints();
        config.tick_hz = tick_hz;
        Rig rig(config);
        ASSERT_EQ(rig.send(quintic({0, 0}, {777, -333}).chunk(0, quintic({0, 0}, {777, -333}).knots(), 0)).code,
                  Code::Ok);
        rig.run_until_idle();
        EXPECT_EQ(rig.steps(0), 777);
        EXPECT_EQ(rig.steps(1), -333);
        EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
    }
}

TEST(Pulses, BeginInTheSlotAfterTheOneThatFollowsTheFirstChunk) {
    Rig rig;
    rig.run_ms(5);
    rig.device.advance(5300);
    rig.device.set_tracing(true);
    ChunkSpec chunk = quintic({0, 0}, {100, 0}).whole();
    for (Row& row : chunk.rows) row.position[0] += 200;  // within a step of the pose, and due at once
    ASSERT_EQ(rig.send(chunk).code, Code::Ok);
    rig.run_ms(5);
    ASSERT_FALSE(rig.device.trace().empty());
    EXPECT_GE(rig.device.trace().front().tick * 20, 7000u);
    EXPECT_LT(rig.device.trace().front().tick * 20, 8000u);
}

TEST(Pulses, StopWhenTheSlotTaskHangsAndTheFaultStays) {
    Rig rig;
    ASSERT_EQ(rig.send(quintic({0, 0}, {3000, 0}).whole()).code, Code::Ok);
    rig.run_ms(800);
    rig.device.advance_without_slots(1);
    const int32_t stopped = rig.steps(0);
    rig.device.advance_without_slots(3);
    EXPECT_LE(rig.steps(0) - stopped, 4);
    rig.run_ms(3);
    EXPECT_EQ(rig.mode(), Mode::Fault);
    EXPECT_EQ(rig.count_events("fault"), 1);
    EXPECT_EQ(rig.send(quintic({0, 0}, {10, 0}).whole(8)).code, Code::NotReady);
    EXPECT_EQ(rig.command(Command::Reset), Code::Ok);
    EXPECT_EQ(rig.mode(), Mode::Unreferenced) << "a dead stop may have lost steps";
    EXPECT_EQ(rig.command(Command::Reference, {0, 0}), Code::Ok);
    EXPECT_EQ(rig.mode(), Mode::Idle);
}
