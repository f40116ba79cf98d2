// Homing: exact to the step from anywhere, within the limits, and stopped by whatever must stop it.
#include <gtest/gtest.h>

#include <random>

#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

void expect_home(const Wired& wired) {
    for (uint8_t j = 0; j < 2; ++j) EXPECT_EQ(wired.steps(j), wired.shaft[j]) << "joint " << int(j);
    EXPECT_EQ(wired.steps(0), -5000 + 60) << "backed off from its switch";
    EXPECT_EQ(wired.steps(1), 3000 - 60);
}

FaultCode fault(const Wired& wired) { return static_cast<FaultCode>(wired.state[17]); }

void expect_fault(Wired& wired, FaultCode code, uint8_t joint) {
    ASSERT_TRUE(wired.run_until(Mode::Fault));
    const uint64_t pulses = wired.pulses;
    wired.run_ms(30);
    EXPECT_EQ(fault(wired), code);
    EXPECT_EQ(wired.state[53], joint);
    EXPECT_EQ(wired.pulses, pulses) << "stopped dead";
    EXPECT_TRUE(wired.machine.is_enabled()) << "the drivers stay on: the arm must not fall";
    EXPECT_FALSE(wired.machine.is_referenced());
    EXPECT_EQ(wired.command(Command::Reset), Code::Ok);
    EXPECT_EQ(wired.machine.mode(), Mode::Unreferenced);
}

}  // namespace

TEST(Homing, IsExactToTheStepFromAnywhereInBothDirections) {
    std::mt19937 random(17);
    std::uniform_int_distribution<> first(-5900, 4000), second(-6000, 3900);
    for (int i = 0; i < 40; ++i) {
        const std::vector<int32_t> start = {first(random), second(random)};
        SCOPED_TRACE(testing::Message() << "from " << start[0] << ", " << start[1]);
        Wired wired(wired_joints(), start);
        wired.run_ms(3 + random() % 5);
        ASSERT_EQ(wired.command(Command::Home), Code::Ok);
        ASSERT_TRUE(wired.run_until(Mode::Idle));
        expect_home(wired);
        for (uint8_t j = 0; j < 2; ++j) {
            EXPECT_LE(wired.fastest(j), 2000 * 1.01) << "no faster than `fast`";
            EXPECT_LE(wired.hardest(j), 8000 * 1.1);
        }
        EXPECT_LE(wired.machine.max_slot_error_q8(), 128u);
        EXPECT_EQ(wired.count_events("\"homed\""), 2);
        EXPECT_NE(wired.statuses.back().find("\"referenced\": true"), std::string::npos);
    }
}

TEST(Homing, LatchesThePositionInTheTickInWhichTheSwitchCloses) {
    // Bounces of the switch, a slot's length and the phase of the closing within a slot make no difference.
    for (uint32_t tick_hz : {20000u, 50000u, 80000u}) {
        DeviceConfig config = wired_joints();
        config.tick_hz = tick_hz;
        config.joint[0].homing.slow_q8 = static_cast<int32_t>(tick_hz / 8) * 256;
        config.joint[0].homing.fast_q8 = static_cast<int32_t>(tick_hz / 8) * 256;
        config.joint[0].homing.back_off_q8 = 700 * 256;
        config.joint[0].max_acceleration_q8 = 200000 * 256;
        Wired wired(config, {123, 0});
        wired.run_ms(5);
        ASSERT_EQ(wired.command(Command::Home, 1), Code::Ok);
        ASSERT_TRUE(wired.run_until(Mode::Unreferenced));
        EXPECT_EQ(wired.steps(0), wired.shaft[0]);
        EXPECT_EQ(wired.steps(0), -5000 + 700);
    }
}

TEST(Homing, MovesOffASwitchThatIsActiveAtTheStart) {
    Wired wired(wired_joints(), {-5300, 3500});
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    wired.run_ms(50);
    EXPECT_GT(wired.shaft[0], -5300);
    EXPECT_LT(wired.shaft[1], 3500);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    expect_home(wired);
}

TEST(Homing, TakesTheGroupsOneAfterTheOther) {
    DeviceConfig config = wired_joints();
    config.joint[0].homing.group = 3;
    config.joint[1].homing.group = 1;
    Wired wired(config, {1000, 0});
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    while (wired.count_events("q2") == 0) {
        ASSERT_EQ(wired.shaft[0], 1000) << "the second group waits";
        wired.run_ms(1);
    }
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    expect_home(wired);
    EXPECT_LT(wired.events[wired.events.size() - 2].find("q2"), std::string::npos);
}

TEST(Homing, TellsHowManyStepsWereLost) {
    Wired wired;
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_NE(wired.events.back().find("\"detail\": \"q"), std::string::npos);
    EXPECT_EQ(wired.count_events("steps off"), 0) << "nothing was known before";
    wired.shaft[0] -= 37;  // the motor slips
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.count_events("\"q1: -37 steps off\""), 1);
    EXPECT_EQ(wired.count_events("\"q2: 0 steps off\""), 1);
    expect_home(wired);
}

TEST(Homing, AMotionThatPassesAHomeSwitchTellsHowManyStepsWereLostAndCorrectsNothing) {
    Wired wired(wired_joints(), {0, 0}, true);
    wired.run_ms(5);
    wired.shaft[0] -= 37;  // the motor slips
    ASSERT_EQ(wired.follow(-5200, 0), Code::Ok);
    wired.run_ms(4000);
    EXPECT_EQ(wired.count_events("\"passed\""), 1);
    EXPECT_EQ(wired.count_events("\"q1: -37 steps off\""), 1);
    EXPECT_EQ(wired.steps(0), -5200);
    ASSERT_EQ(wired.follow(0, 0), Code::Ok);
    wired.run_ms(4000);
    EXPECT_EQ(wired.count_events("\"passed\""), 1) << "the way back opens it";
    EXPECT_EQ(wired.shaft[0], -37);
}

TEST(Homing, OfSomeJointsLeavesTheOthersUnreferenced) {
    Wired wired(wired_joints(), {100, 200});
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home, 1u << 1), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Unreferenced));
    wired.run_ms(30);
    EXPECT_EQ(load_u16(&wired.state[56]), 1u << 1);
    EXPECT_EQ(wired.shaft[0], 100);
    ASSERT_EQ(wired.command(Command::Home, 1u << 0), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    expect_home(wired);
}

TEST(Homing, IsRefusedWhereItCannotBe) {
    DeviceConfig config = wired_joints();
    config.is_armed_at_boot = 0;
    config.enable_lead_ms = 200;
    Wired wired(config);
    wired.run_ms(5);
    EXPECT_EQ(wired.command(Command::Home), Code::NotArmed);
    EXPECT_EQ(wired.command(Command::Arm), Code::Ok);
    EXPECT_EQ(wired.command(Command::Home), Code::NotArmed) << "not for long enough";
    wired.run_ms(200);
    EXPECT_EQ(wired.command(Command::Home, 4), Code::BadArgument);
    EXPECT_EQ(wired.command(Command::Home), Code::Ok);
    EXPECT_EQ(wired.command(Command::Home), Code::NotReady);

    config.joint[0].homing.input = kNone;
    config.is_armed_at_boot = 1;
    config.enable_lead_ms = 0;
    Wired half(config);
    half.run_ms(5);
    EXPECT_EQ(half.command(Command::Home, 1), Code::NoHoming);
    EXPECT_EQ(half.command(Command::Home), Code::Ok) << "all that can";
    config.joint[1].homing.input = kNone;
    Wired none(config);
    none.run_ms(5);
    EXPECT_EQ(none.command(Command::Home), Code::NoHoming);
}

TEST(Homing, EndsInAFaultWhereTheSwitchIsNotFound) {
    Wired wired;
    wired.press(kHome1, Finger::HeldOpen);
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home, 1), Code::Ok);
    expect_fault(wired, FaultCode::SwitchNotFound, 0);
    EXPECT_NEAR(wired.shaft[0], -12000, 10) << "no farther than max_travel";
}

TEST(Homing, EndsInAFaultWhereTheSwitchIsStuck) {
    Wired never_released;
    never_released.press(kHome1);
    never_released.run_ms(5);
    ASSERT_EQ(never_released.command(Command::Home, 1), Code::Ok);
    expect_fault(never_released, FaultCode::SwitchStuck, 0);
    EXPECT_NEAR(never_released.shaft[0], 12000, 10);

    Wired sticks;
    sticks.run_ms(5);
    ASSERT_EQ(sticks.command(Command::Home, 1), Code::Ok);
    while (!sticks.is_closed(kHome1)) sticks.run_ms(1);
    sticks.press(kHome1);
    expect_fault(sticks, FaultCode::SwitchStuck, 0);
    EXPECT_EQ(sticks.count_events("q1: its switch is still active after backing off"), 1);
}

TEST(Homing, EndsInAFaultWhereItTakesTooLong) {
    DeviceConfig config = wired_joints();
    config.joint[0].homing.timeout_ms = 1500;
    Wired wired(config);
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    const uint64_t began_us = wired.now_us;
    expect_fault(wired, FaultCode::HomingTimeout, 0);
    EXPECT_NEAR(static_cast<double>(wired.now_us - began_us), 1.5e6, 50e3);
}

TEST(Homing, IsEndedByALimitSwitchThatIsNotItsOwn) {
    Wired wired;
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home, 1), Code::Ok);
    wired.run_ms(300);
    wired.press(kUpper1);
    wired.run_ms(1);
    expect_fault(wired, FaultCode::LimitSwitch, 0);

    Wired other;
    other.run_ms(5);
    ASSERT_EQ(other.command(Command::Home, 1), Code::Ok);
    other.run_ms(300);
    other.press(kEnd2);  // homes q2, which does not move now
    other.run_ms(1);
    expect_fault(other, FaultCode::LimitSwitch, 1);
}

TEST(Homing, ThatIsStoppedBrakesAndLeavesItsJointsUnreferenced) {
    struct Case {
        const char* cause;
        void (*stop)(Wired&);
    };
    const Case cases[] = {
        {"command", [](Wired& wired) { wired.command(Command::Stop); }},
        {"command", [](Wired& wired) { wired.command(Command::Hold); }},
        {"heartbeat", [](Wired& wired) { wired.run_ms(501, true); }},
        {"shutdown", [](Wired& wired) { wired.machine.halt(); }},
    };
    for (const Case& one : cases) {
        Wired wired;
        wired.run_ms(5);
        ASSERT_EQ(wired.command(Command::Home), Code::Ok);
        wired.run_ms(700);
        one.stop(wired);
        ASSERT_EQ(wired.machine.mode(), Mode::Homing) << "it brakes";
        EXPECT_TRUE(wired.run_until(Mode::Unreferenced, 300));
        EXPECT_EQ(wired.count_events("homing_stopped"), 1);
        EXPECT_EQ(wired.count_events(one.cause), 1);
        EXPECT_LE(wired.hardest(0), 8000 * 1.1);
        const uint64_t pulses = wired.pulses;
        wired.run_ms(1000);
        EXPECT_EQ(wired.pulses, pulses);
        EXPECT_EQ(load_u16(&wired.state[56]), 0u);
        EXPECT_EQ(wired.command(Command::Resume), Code::NotReady);
        ASSERT_EQ(wired.command(Command::Home), Code::Ok);
        ASSERT_TRUE(wired.run_until(Mode::Idle));
        expect_home(wired);
    }
}

TEST(Homing, TakesNoOtherMotionMeanwhile) {
    Wired wired;
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    wired.run_ms(100);
    ChunkSpec chunk;
    chunk.first = chunk.last = true;
    chunk.rows = {Row{{0, 0}, {0, 0}}};
    EXPECT_EQ(wired.send(chunk), Code::NotReady);
    EXPECT_EQ(wired.follow(0, 0), Code::NotReady);
    EXPECT_EQ(wired.command(Command::Reference, 0, 0, {0, 0}), Code::NotReady);
    EXPECT_EQ(wired.command(Command::Disarm), Code::NotReady);
    EXPECT_FALSE(wired.machine.keeps_still());
}
