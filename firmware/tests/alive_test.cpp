// Status, heartbeat and late ticks to the bit and to the slot: what changes by one here is another protocol.
#include <gtest/gtest.h>

#include "motion.h"
#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

constexpr uint64_t kMinuteUs = 60000000;
const Motion kLong = quintic({0, 0}, {6000, -3500});

size_t count_statuses(Rig& rig) {
    size_t count = 0;
    for (const OutFrame& frame : rig.device.outputs()) count += frame.output == Output::Status;
    rig.device.outputs().clear();
    return count;
}

// True if the device has taken `beat` as a sign of life: then it does not hold half a second after the stream's start.
bool counts(Rig& rig, const Bytes& beat, bool is_retained = false, uint64_t age_us = 0) {
    EXPECT_EQ(rig.send(kLong.chunk(0, 100, 0)).code, Code::Ok);
    rig.run_ms(400, true);
    rig.device.receive(beat.data(), beat.size(), is_retained, rig.device.now_us() - age_us);
    rig.run_ms(200, true);
    return rig.mode() == Mode::Run;
}

// Whether `counter` counts in a session that has said 9, so long after it.
bool counts_after(uint64_t silence_us, uint32_t counter) {
    Rig rig;
    rig.device.receive(build_heartbeat(5, 9));
    const uint64_t age_us = (1000 - silence_us % 1000) % 1000;  // the device's clock goes on by whole slots here
    rig.device.stand_still(rig.device.now_us() + silence_us + age_us - 400000);
    return counts(rig, build_heartbeat(5, counter), false, age_us);
}

bool is_late_after(uint64_t stood_us) {
    Rig rig;
    rig.send(kLong.chunk(0, 100, 0));
    rig.run_ms(300);
    rig.device.stand_still(rig.device.now_us() + stood_us);
    rig.run_ms(2);
    return rig.count_events("late") == 1;
}

// Steps in the 20 ms after a gap of 50 ms, of the joint that moved farther.
int steps_after_a_gap(Wired& wired) {
    wired.now_us += 50000;
    const std::vector<int32_t> before = wired.shaft;
    wired.run_ms(20);
    EXPECT_EQ(wired.count_events("\"late\""), 1);
    return std::max(std::abs(wired.shaft[0] - before[0]), std::abs(wired.shaft[1] - before[1]));
}

}  // namespace

TEST(Status, SaysWhoTheDeviceIs) {
    Wired wired(open_field(), {0, 0}, true);
    EXPECT_EQ(
        wired.statuses.back(),
        "{\"online\": true, \"device\": \"wired\", \"firmware\": \"1.0.0\", \"protocol\": [1, 2], "
        "\"boot_id\": 305419896, \"reset_cause\": \"power_on\", \"joints\": 2, \"tick_hz\": 50000, "
        "\"queue_capacity\": 128, \"referenced\": true, \"armed\": true, \"config_crc32\": 0, \"virtual\": false}");
}

TEST(Status, SaysWhatIsLeftOfTheMemoryWhereTheBoardKnowsIt) {
    std::string said;
    Sink sink;
    sink.context = &said;
    sink.put = [](void* context, Output, const uint8_t* bytes, size_t size) {
        static_cast<std::string*>(context)->assign(reinterpret_cast<const char*>(bytes), size);
    };
    sink.memory = [] { return MemoryReport{71000, 40200, 812, "wire"}; };
    Reporter reporter;
    reporter.begin(sink, 1, 2);
    const DeviceConfig config = wired_joints();
    reporter.status(StatusReport{&config, "wired", "power_on", 1, "", true, true, false});
    EXPECT_NE(said.find("\"heap_free\": 71000, \"heap_least\": 40200, \"stack_least\": 812, \"stack_task\": \"wire\""),
              std::string::npos);
}

TEST(Status, IsSaidEveryTenSecondsToTheSlot) {
    Rig rig;
    count_statuses(rig);
    rig.device.advance(9999500);
    EXPECT_EQ(count_statuses(rig), 0u);
    rig.device.advance(10000500);
    EXPECT_EQ(count_statuses(rig), 1u);
    rig.device.advance(19999500);
    EXPECT_EQ(count_statuses(rig), 0u);
    rig.device.advance(20000500);
    EXPECT_EQ(count_statuses(rig), 1u);
    rig.device.stand_still(55000000);
    rig.device.advance(55100000);
    EXPECT_EQ(count_statuses(rig), 1u) << "what was missed is not caught up";
}

TEST(Status, OnRequestIsSaidOnceAndAnsweredOk) {
    Wired wired;
    const size_t before = wired.statuses.size();
    EXPECT_EQ(wired.command(Command::Status), Code::Ok);
    EXPECT_EQ(wired.statuses.size(), before + 1);
}

TEST(Status, IsSaidAfterEverythingThatChangesIt) {
    DeviceConfig config = wired_joints();
    config.is_armed_at_boot = 0;
    Wired wired(config);
    wired.run_ms(5);
    size_t said = wired.statuses.size();
    const auto is_said = [&wired, &said] { return wired.statuses.size() == ++said; };
    ASSERT_EQ(wired.command(Command::Arm), Code::Ok);
    EXPECT_TRUE(is_said());
    ASSERT_EQ(wired.command(Command::Reference, 0, 0, {0, 0}), Code::Ok);
    EXPECT_TRUE(is_said());
    ASSERT_EQ(wired.command(Command::Disarm), Code::Ok);
    EXPECT_TRUE(is_said());
    wired.press(kUpper1);
    wired.run_ms(5);
    ASSERT_EQ(wired.machine.mode(), Mode::Fault);
    EXPECT_TRUE(is_said());
    wired.press(kButton);
    wired.run_ms(5);
    ASSERT_EQ(wired.machine.mode(), Mode::EStop);
    EXPECT_TRUE(is_said());
    wired.machine.restart();
    EXPECT_TRUE(is_said());
}

TEST(Heartbeat, MayJumpBy1024AndByNoMore) {
    for (uint32_t last : {9u, UINT32_MAX - 500}) {
        for (const auto& [jump, is_sign] : {std::pair(1u, true), {1024u, true}, {1025u, false}, {0u, false}}) {
            Rig rig;
            rig.device.receive(build_heartbeat(5, last));
            EXPECT_EQ(counts(rig, build_heartbeat(5, last + jump)), is_sign) << last << " + " << jump;
        }
    }
}

TEST(Heartbeat, MayJumpFartherAfterAMinuteOfSilenceToTheMicrosecond) {
    EXPECT_FALSE(counts_after(kMinuteUs, 9 + 1025));
    EXPECT_TRUE(counts_after(kMinuteUs + 1, 9 + 1025));
    EXPECT_TRUE(counts_after(kMinuteUs + 1, 9u + INT32_MAX));
    EXPECT_FALSE(counts_after(kMinuteUs + 1, 10u + INT32_MAX)) << "that is older";
    EXPECT_FALSE(counts_after(kMinuteUs + 1, 8));
}

TEST(Heartbeat, ThatDoesNotCountIsNoEndOfTheSilence) {
    Rig rig;
    rig.device.receive(build_heartbeat(5, 9));
    rig.device.stand_still(rig.device.now_us() + kMinuteUs / 2);
    rig.device.receive(build_heartbeat(5, 9 + 2000));
    rig.device.stand_still(rig.device.now_us() + kMinuteUs / 2);
    EXPECT_TRUE(counts(rig, build_heartbeat(5, 9 + 2001)));
}

TEST(Heartbeat, ThatCountsEndsTheSilence) {
    Rig rig;
    rig.device.receive(build_heartbeat(5, 9));
    rig.device.stand_still(rig.device.now_us() + kMinuteUs / 2);
    rig.device.receive(build_heartbeat(5, 10));
    rig.device.stand_still(rig.device.now_us() + kMinuteUs / 2);
    EXPECT_FALSE(counts(rig, build_heartbeat(5, 10 + 2000)));
}

TEST(Heartbeat, OfAnotherSessionCountsWhateverItsCounter) {
    for (uint32_t counter : {0u, 9u, UINT32_MAX}) {
        Rig rig;
        rig.device.receive(build_heartbeat(5, 9));
        EXPECT_TRUE(counts(rig, build_heartbeat(6, counter))) << counter;
    }
    Rig rig;
    EXPECT_TRUE(counts(rig, build_heartbeat(0, 0))) << "the very first";
}

TEST(Heartbeat, CountsForThisBootOrForAny) {
    for (const auto& [boot, is_sign] : {std::pair(0u, true), {kBoot, true}, {kBoot + 1, false}}) {
        Rig rig;
        EXPECT_EQ(counts(rig, build_heartbeat(5, 9, boot)), is_sign) << boot;
    }
}

TEST(Heartbeat, ThatIsRetainedOrOfAnotherLengthIsABadFrame) {
    Bytes longer = build_heartbeat(5, 9);
    longer.resize(longer.size() - 4);
    longer.push_back(0);
    for (const auto& [beat, is_retained] : {std::pair(build_heartbeat(5, 9), true), {seal(longer), false}}) {
        Rig rig;
        EXPECT_FALSE(counts(rig, beat, is_retained));
        EXPECT_EQ(rig.state().bad_frames, 1u);
    }
}

TEST(Heartbeat, IsAsOldAsItsReceiptAndTakesNoLifeAway) {
    Rig waited;
    EXPECT_FALSE(counts(waited, build_heartbeat(5, 9), false, 350000)) << "it has waited in the device";
    Rig old;
    old.run_ms(1000, true);
    ASSERT_EQ(old.send(kLong.chunk(0, 100, 0)).code, Code::Ok);
    const Bytes beat = build_heartbeat(5, 9);
    old.device.receive(beat.data(), beat.size(), false, old.device.now_us() - 900000);
    old.run_ms(400, true);
    EXPECT_EQ(old.mode(), Mode::Run) << "the stream's start is a later sign of life";
}

TEST(Heartbeat, IsMissedHalfASecondAfterTheLastOneToTheSlot) {
    Rig rig;
    ASSERT_EQ(rig.send(kLong.chunk(0, 100, 0)).code, Code::Ok);
    const uint64_t begun_us = rig.device.now_us();
    rig.run_ms(800, true);
    const uint64_t held_us = begun_us + 501000;
    EXPECT_NE(rig.event("hold").find("\"t_us\": " + std::to_string(held_us)), std::string::npos) << rig.event("hold");
}

TEST(LateTicks, AreSuchFromTheFifthMissedMillisecondOn) {
    EXPECT_FALSE(is_late_after(3000));
    EXPECT_TRUE(is_late_after(4000));
    EXPECT_TRUE(is_late_after(39000));
}

TEST(Silence, AsksForASubscriptionOnceInFourSecondsWithoutAHeartbeat) {
    Rig rig;
    const auto asks_after = [&rig](uint64_t us) {
        rig.device.stand_still(rig.device.now_us() + us);
        return rig.device.machine().subscribes_anew(rig.device.now_us());
    };
    rig.device.receive(build_heartbeat(5, 9));
    EXPECT_FALSE(asks_after(3999000));
    EXPECT_TRUE(asks_after(1000));
    EXPECT_FALSE(asks_after(3999000));
    EXPECT_TRUE(asks_after(1000));
    rig.device.receive(build_heartbeat(5, 10));
    EXPECT_FALSE(asks_after(3999000));
    rig.device.receive(build_heartbeat(5, 10));  // a repeated one is none
    EXPECT_TRUE(asks_after(1000));
}

TEST(LateTicks, AreToldWithTheirNumberOfMilliseconds) {
    Rig rig;
    rig.send(kLong.chunk(0, 100, 0));
    rig.run_ms(300);
    rig.device.stand_still(rig.device.now_us() + 2900000);
    rig.run_ms(2);
    EXPECT_NE(rig.event("late").find("\"detail\": \"2901 ms\""), std::string::npos) << rig.event("late");
}

TEST(LateTicks, InAHoldAreToldToo) {
    Rig rig;
    rig.send(kLong.chunk(0, 100, 0));
    rig.run_ms(400);
    ASSERT_EQ(rig.command(Command::Hold), Code::Ok);
    rig.run_ms(5);
    const int32_t before = rig.steps(0);
    rig.device.stand_still(rig.device.now_us() + 50000);
    rig.run_ms(500);
    EXPECT_EQ(rig.count_events("late"), 1);
    EXPECT_LE(std::abs(rig.steps(0) - before), 2 * 4 + 1) << "it stands already";
}

// Two slots at full speed are under way; from rest come 8000 steps/s^2 of 20 ms.
TEST(LateTicks, LetEveryJointOfTextModeGoOnFromRest) {
    for (const auto& [first, second] : {std::pair(6000, 0), {0, -6000}}) {
        Wired wired(open_field(), {0, 0}, true);
        ASSERT_EQ(wired.follow(first, second), Code::Ok);
        wired.run_ms(600);
        EXPECT_LE(steps_after_a_gap(wired), 2 * 4 + 2 + 1);
        ASSERT_TRUE(wired.run_until(Mode::Idle));
        EXPECT_EQ(wired.shaft, (std::vector<int32_t>{first, second}));
    }
}

TEST(LateTicks, LetHomingGoOnFromRest) {
    Wired wired(wired_joints(), {4000, -6000});
    wired.run_ms(5);
    ASSERT_EQ(wired.command(Command::Home), Code::Ok);
    wired.run_ms(400);
    EXPECT_LE(steps_after_a_gap(wired), 2 * 2 + 2 + 1);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.steps(0), wired.shaft[0]);
}
