// E-stop, limit switches, arming, faults and outputs.
#include <gtest/gtest.h>

#include <random>

#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

// Both joints at speed, in text mode: referenced, far from the ends.
void move(Wired& wired) {
    ASSERT_EQ(wired.follow(20000, -20000), Code::Ok);
    wired.run_ms(900);
    ASSERT_EQ(wired.machine.mode(), Mode::Run);
}

Mode mode_in_state(const Wired& wired) { return static_cast<Mode>(wired.state[16]); }

ChunkSpec start_chunk() {
    ChunkSpec chunk;
    chunk.first = true;
    chunk.dt_us = 100000;
    chunk.rows = {Row{{0, 0}, {0, 0}}, Row{{256, 0}, {0, 0}}};
    return chunk;
}

}  // namespace

TEST(EStop, SilencesTheStepsWithinOneTickAtAnyMoment) {
    std::mt19937 random(23);
    for (int i = 0; i < 60; ++i) {
        Wired wired(open_field(), {0, 0}, true);
        wired.run_ms(5);
        if (i % 3 == 0) {
            ASSERT_EQ(wired.command(Command::Home), Code::Ok);
        } else {
            ASSERT_EQ(wired.follow(20000, -20000), Code::Ok);
        }
        wired.run_ms(300 + random() % 700);
        for (uint32_t n = random() % 50; n != 0; --n) wired.tick();
        const uint64_t pulses = wired.pulses;
        wired.press(kButton);
        for (int n = 0; n < 500; ++n) wired.tick();
        ASSERT_EQ(wired.pulses, pulses) << "not one more pulse begins";
        EXPECT_EQ(wired.machine.mode(), Mode::EStop);
        EXPECT_FALSE(wired.machine.is_enabled());
        EXPECT_EQ(wired.machine.stepper().pins().step, 0u);
    }
}

TEST(EStop, NeedsOneReadingOnlyAndIsLatched) {
    Wired wired(open_field(), {0, 0}, true);
    move(wired);
    wired.press(kButton);
    wired.tick();
    wired.press(kButton, Finger::Off);
    const uint64_t pulses = wired.pulses;
    wired.run_ms(1000);
    EXPECT_EQ(wired.pulses, pulses);
    EXPECT_EQ(wired.machine.mode(), Mode::EStop);
    EXPECT_EQ(wired.count_events("\"estop\""), 2) << "the event, and why it was disarmed";
    EXPECT_EQ(wired.count_events("stop_button"), 1);
}

TEST(EStop, LeavesOnlyByAResetOnceReleasedAndUnreferencesAll) {
    Wired wired(open_field(), {0, 0}, true);
    move(wired);
    wired.press(kButton);
    wired.run_ms(30);
    EXPECT_EQ(wired.command(Command::Reset), Code::EstopPressed);
    EXPECT_EQ(wired.command(Command::Arm), Code::EstopPressed);
    EXPECT_EQ(wired.command(Command::Resume), Code::NotReady);
    EXPECT_EQ(wired.follow(0, 0), Code::NotReady);
    EXPECT_EQ(mode_in_state(wired), Mode::EStop);
    EXPECT_EQ(wired.state[17], static_cast<uint8_t>(FaultCode::EmergencyStop));
    EXPECT_EQ(wired.state[52] & kFlagArmed, 0);
    EXPECT_EQ(load_u16(&wired.state[56]), 0u);
    wired.press(kButton, Finger::Off);
    wired.run_ms(30);
    EXPECT_EQ(wired.machine.mode(), Mode::EStop) << "released is not reset";
    EXPECT_EQ(wired.command(Command::Arm), Code::NotReady);
    EXPECT_EQ(wired.command(Command::Reset), Code::Ok);
    EXPECT_EQ(wired.machine.mode(), Mode::Unreferenced);
    EXPECT_FALSE(wired.machine.is_enabled()) << "a person arms it";
    EXPECT_EQ(wired.command(Command::Home), Code::NotArmed);
    EXPECT_EQ(wired.command(Command::Arm), Code::Ok);
    EXPECT_EQ(wired.command(Command::Home), Code::Ok);
    wired.run_ms(500);
    EXPECT_GT(wired.fastest(0), 100);
    wired.press(kButton);
    wired.run_ms(2);
    EXPECT_EQ(wired.machine.mode(), Mode::EStop) << "it works again";
}

TEST(EStop, ThatIsPressedAtTheStartKeepsTheDeviceOff) {
    Wired wired(open_field(), {0, 0}, true);
    wired.press(kButton);
    wired.run_ms(5);
    EXPECT_EQ(wired.machine.mode(), Mode::EStop);
    EXPECT_FALSE(wired.machine.is_enabled());
}

TEST(EStop, ComesOnTopOfAFault) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    wired.press(kUpper1);
    wired.run_ms(5);
    EXPECT_EQ(wired.machine.mode(), Mode::Fault);
    wired.press(kButton);
    wired.run_ms(2);
    EXPECT_EQ(wired.machine.mode(), Mode::EStop);
    EXPECT_EQ(wired.count_events("stop_button"), 1) << "not the switch of the fault before";
}

TEST(EStop, ThatIsOnlyTappedIsNotLostInTheResetOfAFault) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    wired.press(kUpper1);
    wired.run_ms(5);
    ASSERT_EQ(wired.machine.mode(), Mode::Fault);
    for (int n = 0; n < 10; ++n) wired.tick();
    wired.press(kButton);
    wired.tick();
    wired.press(kButton, Finger::Off);
    for (int n = 0; n < 10; ++n) wired.tick();
    EXPECT_EQ(wired.command(Command::Reset), Code::EstopPressed);
    for (int n = 0; n < 50; ++n) wired.tick();
    EXPECT_EQ(wired.machine.mode(), Mode::EStop);
    EXPECT_FALSE(wired.machine.is_enabled());
}

TEST(EStop, OfADisarmedDeviceOutlivesANewConfiguration) {
    for (bool is_held : {true, false}) {
        Wired wired(open_field());
        wired.run_ms(5);
        EXPECT_EQ(wired.command(Command::Disarm), Code::Ok);
        wired.press(kButton);
        wired.run_ms(2);
        ASSERT_EQ(wired.machine.mode(), Mode::EStop);
        if (!is_held) wired.press(kButton, Finger::Off);
        wired.run_ms(2);
        ASSERT_TRUE(wired.machine.takes_config());
        wired.machine.restart();
        EXPECT_EQ(wired.machine.outputs(), 0u) << "the laser is on at boot, and off at an e-stop";
        wired.run_ms(25);
        EXPECT_EQ(wired.machine.mode(), Mode::EStop);
        EXPECT_EQ(wired.state[17], static_cast<uint8_t>(FaultCode::EmergencyStop));
        EXPECT_EQ(wired.command(Command::Arm), is_held ? Code::EstopPressed : Code::NotReady);
        EXPECT_EQ(wired.command(Command::Reset), is_held ? Code::EstopPressed : Code::Ok);
        EXPECT_EQ(wired.machine.mode(), is_held ? Mode::EStop : Mode::Unreferenced);
    }
}

TEST(EStop, SwitchesOffTheOutputsThatItShall) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    EXPECT_EQ(wired.machine.outputs(), 2u) << "as at_boot says";
    EXPECT_EQ(wired.command(Command::Output, 1, 0), Code::Ok);
    EXPECT_EQ(wired.machine.outputs(), 3u);
    wired.press(kButton);
    wired.run_ms(25);
    EXPECT_EQ(wired.machine.outputs(), 1u);
    EXPECT_EQ(load_u16(&wired.state[54]), 1u);
    EXPECT_EQ(wired.command(Command::Output, 1, 1), Code::EstopPressed);
    EXPECT_EQ(wired.command(Command::Output, 0, 0), Code::Ok);
    EXPECT_EQ(wired.command(Command::Output, 2, 0), Code::BadArgument);
    EXPECT_EQ(wired.command(Command::Output, 1, 2), Code::BadArgument);
}

TEST(LimitSwitch, OutsideHomingIsAFaultWithinThatTick) {
    std::mt19937 random(29);
    for (int i = 0; i < 30; ++i) {
        Wired wired(open_field(), {0, 0}, true);
        wired.run_ms(5);
        move(wired);
        for (uint32_t n = random() % 50; n != 0; --n) wired.tick();
        wired.press(kUpper1);
        wired.tick(), wired.tick();
        const uint64_t pulses = wired.pulses;
        wired.run_ms(25);
        EXPECT_EQ(wired.pulses, pulses) << "the third reading ends it";
        EXPECT_EQ(wired.machine.mode(), Mode::Fault);
        EXPECT_EQ(wired.state[17], static_cast<uint8_t>(FaultCode::LimitSwitch));
        EXPECT_EQ(wired.state[53], 0u);
        EXPECT_EQ(wired.count_events("upper_1"), 1);
        EXPECT_TRUE(wired.machine.is_enabled());
        EXPECT_EQ(wired.command(Command::Reset), Code::Ok);
        EXPECT_EQ(wired.machine.mode(), Mode::Unreferenced) << "a dead stop may have lost steps";
    }
}

TEST(LimitSwitch, AtRestIsAFaultThatLosesNothing) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    wired.press(kUpper1);
    wired.run_ms(2);
    EXPECT_EQ(wired.machine.mode(), Mode::Fault);
    EXPECT_EQ(wired.command(Command::Reset), Code::Ok);
    EXPECT_EQ(wired.machine.mode(), Mode::Idle);
}

TEST(LimitSwitch, ThatIsActiveAlreadyIsPassedOverUntilItIsReleased) {
    for (bool at_start : {true, false}) {
        Wired wired(open_field(), {0, 0}, true);
        if (!at_start) wired.run_ms(10);
        wired.press(kUpper1);
        wired.run_ms(10);
        EXPECT_EQ(wired.machine.mode(), at_start ? Mode::Idle : Mode::Fault);
        EXPECT_EQ(wired.command(Command::Reset), Code::Ok);
        ASSERT_EQ(wired.follow(-20000, -20000), Code::Ok);
        wired.run_ms(900);
        wired.press(kUpper1, Finger::Off);
        wired.run_ms(10);
        EXPECT_EQ(wired.machine.mode(), Mode::Run);
        wired.press(kUpper1);
        wired.run_ms(2);
        EXPECT_EQ(wired.machine.mode(), Mode::Fault);
    }
}

TEST(LimitSwitch, ThatIsActiveAlreadyLetsItsJointOffItOnly) {
    Wired wired(open_field(), {0, 0}, true);
    wired.press(kUpper1);
    wired.run_ms(10);
    for (int attempt = 0; attempt < 2; ++attempt) {
        ASSERT_EQ(wired.follow(20000, 0), Code::Ok);
        wired.run_ms(30);
        EXPECT_EQ(wired.machine.mode(), Mode::Fault);
        EXPECT_EQ(wired.state[17], static_cast<uint8_t>(FaultCode::LimitSwitch));
        EXPECT_EQ(wired.state[53], 0u);
        EXPECT_EQ(wired.pulses, 0u) << "not one step further into it";
        ASSERT_EQ(wired.command(Command::Reset), Code::Ok);
        EXPECT_EQ(wired.machine.mode(), Mode::Idle) << "nothing has moved, so nothing is lost";
    }
    ASSERT_EQ(wired.follow(0, 5000), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle)) << "the other joint is free";
    ASSERT_EQ(wired.follow(-300, 5000), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.shaft[0], -300);
    EXPECT_EQ(wired.shaft[1], 5000);
}

TEST(HomeSwitch, IsNoLimit) {
    Wired wired(open_field(), {0, 0}, true);
    move(wired);
    wired.press(kHome1);
    wired.run_ms(10);
    EXPECT_EQ(wired.machine.mode(), Mode::Run);
}

TEST(Arming, IsBelievedAtTheStartOnlyIfTheConfigurationSaysSo) {
    DeviceConfig config = open_field();
    Wired armed(config, {0, 0}, true);
    EXPECT_EQ(armed.machine.mode(), Mode::Idle);
    EXPECT_EQ(armed.count_events("\"event\": \"armed\""), 1);
    EXPECT_NE(armed.statuses.back().find("\"armed\": true"), std::string::npos);
    config.is_armed_at_boot = 0;
    Wired disarmed(config, {0, 0}, true);
    EXPECT_EQ(disarmed.machine.mode(), Mode::Unreferenced) << "a motor without current may have been turned";
    EXPECT_FALSE(disarmed.machine.is_enabled());
    EXPECT_NE(disarmed.statuses.back().find("\"armed\": false"), std::string::npos);
}

TEST(Arming, GivesTheDriversTheirLeadBeforeMotion) {
    DeviceConfig config = open_field();
    config.enable_lead_ms = 200;
    config.is_armed_at_boot = 0;
    Wired wired(config);
    wired.run_ms(5);
    EXPECT_EQ(wired.command(Command::Reference, 0, 0, {0, 0}), Code::NotArmed);
    EXPECT_EQ(wired.command(Command::Arm), Code::Ok);
    EXPECT_EQ(wired.command(Command::Arm), Code::Ok) << "armed already";
    EXPECT_EQ(wired.command(Command::Reference, 0, 0, {0, 0}), Code::Ok);
    EXPECT_EQ(wired.follow(5, 5), Code::NotArmed);
    EXPECT_EQ(wired.send(start_chunk()), Code::NotArmed);
    wired.run_ms(199);
    EXPECT_EQ(wired.send(start_chunk()), Code::NotArmed);
    wired.run_ms(1);
    EXPECT_EQ(wired.send(start_chunk()), Code::Ok);
}

TEST(Disarming, IsTakenAtRestOnlyAndUnreferences) {
    Wired wired(open_field(), {0, 0}, true);
    move(wired);
    EXPECT_EQ(wired.command(Command::Disarm), Code::NotReady);
    EXPECT_EQ(wired.command(Command::Stop), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.command(Command::Disarm), Code::Ok);
    EXPECT_EQ(wired.machine.mode(), Mode::Unreferenced);
    EXPECT_FALSE(wired.machine.is_enabled());
    EXPECT_FALSE(wired.machine.is_referenced());
    EXPECT_EQ(wired.command(Command::Disarm), Code::Ok);
    EXPECT_EQ(wired.count_events("\"event\": \"disarmed\""), 1);
    EXPECT_TRUE(wired.machine.takes_config());
}

TEST(Reference, OfOneJointLeavesTheOthersAsTheyAre) {
    Wired wired(open_field());
    wired.run_ms(5);
    EXPECT_EQ(wired.command(Command::Reference, 2, 0, {999 * 256, 70 * 256}), Code::Ok);
    EXPECT_EQ(wired.machine.mode(), Mode::Unreferenced);
    EXPECT_EQ(wired.steps(0), 0);
    EXPECT_EQ(wired.steps(1), 70);
    EXPECT_EQ(wired.command(Command::Reference, 4, 0, {0, 0}), Code::BadArgument);
    EXPECT_EQ(wired.command(Command::Reference, 1, 0, {9 * 256, 0}), Code::Ok);
    EXPECT_EQ(wired.machine.mode(), Mode::Idle);
    EXPECT_EQ(wired.steps(0), 9);
    EXPECT_EQ(wired.steps(1), 70);
}

TEST(Restart, BeginsAnewWithANewConfigurationDisarmedAndUnreferenced) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    EXPECT_FALSE(wired.machine.takes_config()) << "armed";
    EXPECT_EQ(wired.command(Command::Speed, 500), Code::Ok);
    EXPECT_EQ(wired.command(Command::Disarm), Code::Ok);
    for (int n = 0; n < 17; ++n) wired.tick();  // within a slot
    wired.machine.restart();
    for (int n = 0; n < 33; ++n) wired.tick();
    wired.run_ms(30);
    EXPECT_EQ(wired.machine.mode(), Mode::Unreferenced);
    EXPECT_FALSE(wired.machine.is_enabled()) << "though it is armed at boot";
    EXPECT_EQ(wired.count_events("configured"), 1);
    EXPECT_EQ(load_u16(&wired.state[58]), 1000u);
    EXPECT_EQ(wired.machine.outputs(), 2u);
    EXPECT_EQ(wired.command(Command::Arm), Code::Ok);
    EXPECT_EQ(wired.command(Command::Reference, 0, 0, {0, 0}), Code::Ok);
    EXPECT_EQ(wired.follow(100, 200), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.shaft[0], 100);
    EXPECT_EQ(wired.shaft[1], 200);
}

TEST(Restart, RemembersWhatWasCommandedInThisBoot) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    const Bytes output = build_command(Command::Output, 900, {}, kNever, kBoot, 0, 1);
    wired.give(output);
    EXPECT_EQ(wired.machine.outputs(), 3u);
    EXPECT_EQ(wired.command(Command::Disarm), Code::Ok);
    wired.machine.restart();
    wired.run_ms(5);
    EXPECT_EQ(wired.machine.outputs(), 2u);
    wired.give(output);
    EXPECT_EQ(wired.machine.outputs(), 2u) << "a repeated command is not done again";
}

// A platform writes its flash only then.
TEST(Keeping, StillIsSaidOnlyWhereNothingMovesAndNoPulseIsDue) {
    Wired wired(open_field(), {0, 0}, true);
    wired.run_ms(5);
    ASSERT_TRUE(wired.machine.keeps_still());
    ASSERT_EQ(wired.follow(1500, -700), Code::Ok);
    uint64_t seen = wired.pulses;
    for (int n = 0; n < 100000; ++n) {
        const bool is_still = wired.machine.keeps_still();
        seen = wired.pulses;
        wired.tick();
        if (is_still) {
            ASSERT_EQ(wired.pulses, seen) << "tick " << n;
        }
    }
    EXPECT_TRUE(wired.machine.keeps_still());
    EXPECT_EQ(wired.shaft[0], 1500);
}

TEST(Boot, WithoutAConfigurationSaysSoAndMovesNothing) {
    DeviceConfig config{};
    Wired wired(wired_joints());  // for its frames and ears
    Machine machine;
    std::vector<std::string> said;
    const auto hear = [](void* self, Output output, const uint8_t* bytes, size_t size) {
        if (output == Output::Status) static_cast<std::vector<std::string>*>(self)->emplace_back(bytes, bytes + size);
    };
    machine.begin(config, Identity{kBoot, "power_on", true, "rm1"}, Sink{&said, hear});
    const int32_t steps[kMaxJoints] = {};
    machine.start(0, steps, true);
    for (int ms = 0; ms < 100; ++ms) {
        for (int n = 0; n < 50; ++n) machine.stepper().tick(Levels{});
        machine.slot(static_cast<uint64_t>(ms) * 1000);
    }
    ASSERT_EQ(said.size(), 1u);
    EXPECT_EQ(machine.mode(), Mode::Boot);
    for (const char* part : {"\"device\": \"rm1\"", "\"joints\": 0", "\"tick_hz\": 0", "\"referenced\": false",
                             "\"armed\": false", "\"config_crc32\": 0", "\"virtual\": true"})
        EXPECT_NE(said[0].find(part), std::string::npos) << part;
    EXPECT_TRUE(machine.takes_config());
    EXPECT_FALSE(machine.is_enabled());
    EXPECT_EQ(machine.follow(steps, 0), Code::NotReady);
    config = wired_joints();
    machine.restart();
    EXPECT_EQ(machine.mode(), Mode::Unreferenced);
}
