// The properties of a device that plays random streams, whatever people, links and failing parts do to them.
//
// GEMELO_SEED begins elsewhere, GEMELO_STEPS plays more or fewer steps; both are fixed otherwise. README.md has the
// changes of the core that these tests were seen to catch, such as a dropped step, a ceiling off by a slot and a hold
// that creeps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "play.h"

using namespace gemelo;
using namespace property;

namespace {

uint64_t from_environment(const char* name, uint64_t fallback) {
    const char* text = std::getenv(name);
    return text == nullptr ? fallback : std::strtoull(text, nullptr, 10);
}

uint64_t first_seed() { return from_environment("GEMELO_SEED", 1); }

// Under the sanitizers everything takes ten times as long.
uint64_t share_of(uint64_t plays) { return std::max<uint64_t>(1, plays * GEMELO_PROPERTY_STEPS / 50000000); }

void expect_none(const Findings& findings, Property property) {
    EXPECT_EQ(findings.count(property), 0u) << "the first: " << findings.first(property);
}

// Device times of all widths: with and without a wrap of 32 bits, signed or not, on the way.
uint64_t begin_us(uint64_t seed) {
    constexpr uint64_t kBegins[] = {0, (1ull << 32) - 7000000, (1ull << 31) - 3000000, (1ull << 53) + 12345};
    return kBegins[seed % 4];
}

}  // namespace

// Plays until enough steps were made, and then looks for each property by its name.
class Plays : public testing::Test {
  protected:
    static void SetUpTestSuite() {
        const uint64_t wanted = from_environment("GEMELO_STEPS", GEMELO_PROPERTY_STEPS);
        for (uint64_t seed = first_seed(); steps < wanted; ++seed, ++plays) {
            Play play(PlaySpec{seed, 20, false, begin_us(seed)}, findings);
            play.run();
            steps += play.pulses();
        }
        std::printf("property: %llu steps in %llu plays from seed %llu\n", static_cast<unsigned long long>(steps),
                    static_cast<unsigned long long>(plays), static_cast<unsigned long long>(first_seed()));
    }

    static Findings findings;
    static uint64_t steps, plays;
};

Findings Plays::findings;
uint64_t Plays::steps = 0, Plays::plays = 0;

TEST_F(Plays, AmountToTheStepsThatWereAskedFor) {
    EXPECT_GE(steps, from_environment("GEMELO_STEPS", GEMELO_PROPERTY_STEPS));
}

TEST_F(Plays, MakeFloorOfThePathPlusAHalfStepsByEverySlotsEnd) { expect_none(findings, Property::EmittedSteps); }

TEST_F(Plays, GiveEveryDriverThePulsesAndTheSetUpOfItsDataSheet) { expect_none(findings, Property::PulseTiming); }

TEST_F(Plays, KeepVelocityAndAccelerationWithinTheLimits) { expect_none(findings, Property::Limits); }

TEST_F(Plays, NeverLeaveTheGeometricPath) { expect_none(findings, Property::OnThePath); }

TEST_F(Plays, AreSilentWithinATickOfTheEStopAndThreeOfASwitch) { expect_none(findings, Property::EStop); }

TEST_F(Plays, AreTakenAsTheProtocolSaysAndComeToTheirEnd) { expect_none(findings, Property::Answers); }

// In a time step of a quarter of a second a joint brakes, turns and speeds up: a resumption may take from both.
TEST(Resumption, ThroughAReversalKeepsTheAccelerationWhereverItStood) {
    Findings findings;
    for (int64_t hold_ms = 300; hold_ms < 1300; hold_ms += 20) {
        findings.context = "held at " + std::to_string(hold_ms) + " ms";
        Dice dice(5);
        Bench bench = random_bench(dice);
        bench.config.joints = 1;
        bench.config.inputs = 0;
        bench.config.joint[0].max_velocity_q8 = bench.config.joint[0].max_acceleration_q8 = 2000 * 256;
        bench.config.joint[0].lower_q8 = -(bench.config.joint[0].upper_q8 = 1000 * 256);
        Stand stand(bench, findings, 0, 1, true, 5);
        rig::ChunkSpec chunk;
        chunk.boot_id = 1;
        chunk.dt_us = 250000;
        chunk.first = chunk.last = true;
        int32_t place_q8 = 0, before = 0;
        for (int32_t v : {0, -500, -700, -250, 250, 700, 500, 0}) {
            place_q8 += (before + v) * 256 / 8;
            chunk.rows.push_back(rig::Row{{place_q8}, {v * 256}});
            before = v;
        }
        stand.deliver(rig::build(chunk));
        ASSERT_EQ(stand.chunk_answer->code, Code::Ok);
        PlayedPath path;
        path.begin(chunk);
        stand.inspector->expect_stream(chunk.stream, path);
        for (int64_t ms = 0; ms < 5000; ++ms) {
            if (ms % 200 == 0) stand.beat();
            if (ms == hold_ms) stand.deliver(rig::build_command(Command::Hold, 1, {}, rig::kNever, 1));
            if (ms == hold_ms + 1000) stand.deliver(rig::build_command(Command::Resume, 2, {}, rig::kNever, 1));
            stand.run_slot();
        }
        EXPECT_EQ(stand.mode(), Mode::Idle);
    }
    expect_none(findings, Property::Limits);
    expect_none(findings, Property::OnThePath);
}

// Straight into the interrupt's side: whatever a slot asks for, reversals at full speed among it.
TEST(Stepper, MakesAnyIncrementsWithinTheDriversTimesAndOwesNothingInTheEnd) {
    Findings findings;
    for (uint64_t seed = first_seed(); seed < first_seed() + 40; ++seed) {
        SCOPED_TRACE(seed);
        Dice dice(seed);
        Bench bench = random_bench(dice);
        bench.config.inputs = 0;
        Stepper stepper;
        stepper.begin(bench.config);
        const int64_t zero[kMaxJoints] = {};
        stepper.place(zero);
        Oscilloscope scope(bench, stepper.pins(), findings);
        const uint32_t ticks = ticks_per_slot(bench.config);
        const int64_t most = (static_cast<int64_t>(ticks) << kFineBits) * 63 / 128;
        std::vector<int64_t> place(bench.config.joints);
        for (int slot = 0; slot < 2000; ++slot) {
            int32_t increment[kMaxJoints] = {};
            for (size_t j = 0; j < place.size() && slot < 1990; ++j) {
                increment[j] = static_cast<int32_t>(dice.between(-most, most));
                place[j] += increment[j];
            }
            for (uint32_t tick = 0; tick < ticks; ++tick) {
                stepper.tick(Levels{});
                scope.see(stepper.pins());
                if (tick == 0) stepper.offer(increment);
            }
        }
        for (uint8_t j = 0; j < place.size(); ++j) {
            const int64_t wanted = (place[j] + kFineStep / 2) >> kFineBits;
            EXPECT_EQ(scope.count(j), wanted);
            EXPECT_EQ(stepper.executed(j), wanted);
        }
        EXPECT_TRUE(stepper.is_quiet());
    }
    expect_none(findings, Property::PulseTiming);
}

namespace {

void work(Stand& stand, Gateway& gateway, int64_t ms) {
    for (; ms > 0; --ms) {
        stand.run_to_a_tick();
        gateway.work();
        stand.run_to_slot_end();
    }
}

bool has_come_to_rest(const Stand& stand, const Gateway& gateway) {
    const Point& point = stand.machine.present();
    if (stand.mode() == Mode::Hold) return point.scale_q30 == 0;
    return stand.mode() == Mode::Idle || point.play_us == gateway.live()->end_us();
}

}  // namespace

// A gateway that dies: half of the times only what it steers, half of the times its heartbeat too.
TEST(Cut, OfASteeredStreamEndsAtRestWheneverItComes) {
    Findings findings;
    int ends = 0, holds = 0;
    uint64_t pulses = 0;
    for (uint64_t seed = first_seed(); seed < first_seed() + 40 * share_of(50); ++seed) {
        SCOPED_TRACE(seed);
        findings.context = "seed " + std::to_string(seed);
        Dice dice(seed);
        Stand stand(random_bench(dice), findings, 0, 1, true, seed);
        Gateway gateway(stand, 1, seed, false);
        gateway.open_stream(true);
        work(stand, gateway, dice.between(200, 3000));
        gateway.is_feeding = false;
        gateway.is_beating = seed % 2 == 0;
        work(stand, gateway, 170);  // what is under way
        const bool has_stop = gateway.live()->rests() && !has_come_to_rest(stand, gateway);
        const int underruns = stand.events("underrun");
        for (int ms = 0; ms < 20000 && !has_come_to_rest(stand, gateway); ++ms) work(stand, gateway, 1);
        work(stand, gateway, 3);
        pulses += stand.scope->pulses();
        EXPECT_TRUE(stand.machine.stepper().is_quiet());
        EXPECT_TRUE(!has_stop || stand.events("underrun") == underruns);
        if (stand.mode() == Mode::Hold) {
            EXPECT_FALSE(gateway.is_beating);
            ++holds;
            continue;
        }
        ++ends;
        for (uint8_t j = 0; j < stand.bench.config.joints; ++j)
            EXPECT_EQ(stand.machine.stepper().executed(j), (gateway.target()[j] + 128) >> 8);
    }
    EXPECT_GT(ends, holds);
    EXPECT_GT(pulses, 10000u);
    expect_none(findings, Property::EmittedSteps);
    expect_none(findings, Property::Limits);
    expect_none(findings, Property::OnThePath);
    expect_none(findings, Property::Answers);
}

TEST(Idempotence, SayingEveryFrameTwiceChangesNoPinAndNoWord) {
    Findings findings;
    for (uint64_t seed = first_seed(); seed < first_seed() + share_of(20); ++seed) {
        SCOPED_TRACE(seed);
        Play once(PlaySpec{seed, 10}, findings), twice(PlaySpec{seed, 10, true}, findings);
        once.run();
        twice.run();
        EXPECT_EQ(twice.stand().pins_hash(), once.stand().pins_hash());
        EXPECT_EQ(twice.stand().words_hash(), once.stand().words_hash());
    }
    expect_none(findings, Property::Idempotence);
}

TEST(Reboot, InTheMiddleOfAStreamMakesEveryOldFrameVoidAndThePlaceUnknown) {
    Findings findings;
    uint64_t pulses = 0;
    for (uint64_t seed = first_seed(); seed < first_seed() + share_of(40); ++seed) {
        SCOPED_TRACE(seed);
        Dice dice(seed);
        const Bench bench = random_bench(dice);
        Stand before(bench, findings, 0, 1, true, seed);
        Gateway gateway(before, 1, seed, false);
        gateway.open_stream();
        for (int64_t ms = dice.between(300, 2000); ms > 0; --ms) {
            before.run_to_a_tick();
            gateway.work();
            before.run_to_slot_end();
        }
        Stand after(bench, findings, 0, 2, false, seed);
        for (int ms = 0; ms < 500; ++ms) {
            after.run_to_a_tick();
            for (const rig::Bytes& frame : gateway.said()) {
                after.deliver(frame);
                EXPECT_EQ(after.chunk_answer ? after.chunk_answer->code : *after.command_answer, Code::WrongBoot);
            }
            after.run_to_slot_end();
        }
        EXPECT_FALSE(gateway.said().empty());
        pulses += before.scope->pulses();
        EXPECT_EQ(after.mode(), Mode::Unreferenced);
        EXPECT_EQ(after.scope->pulses(), 0u);
    }
    EXPECT_GT(pulses, 1000u) << "nothing moved before";
}

TEST(Wrap, OfDeviceTimeMovesNoPin) {
    Findings findings;
    for (uint64_t seed = first_seed(); seed < first_seed() + share_of(12); ++seed) {
        SCOPED_TRACE(seed);
        Play early(PlaySpec{seed, 10}, findings);
        early.run();
        for (uint64_t begin : {(1ull << 32) - 5000000, (1ull << 31) - 5000000, (1ull << 63) - 5000000}) {
            Play late(PlaySpec{seed, 10, false, begin}, findings);
            late.run();
            EXPECT_EQ(late.stand().pins_hash(), early.stand().pins_hash()) << begin;
        }
    }
}

TEST(Wrap, OfTheHeartbeatCounterIsNoSilence) {
    Findings findings;
    for (uint64_t seed = first_seed(); seed < first_seed() + share_of(10); ++seed) {
        SCOPED_TRACE(seed);
        Dice dice(seed);
        Stand stand(random_bench(dice), findings, 0, 1, true, seed);
        Gateway gateway(stand, 1, seed, false);
        gateway.open_stream();
        // At most 50 beats of 0.2 s before the counter wraps.
        for (int ms = 0; ms < 12000; ++ms) {
            stand.run_to_a_tick();
            gateway.work();
            stand.run_to_slot_end();
        }
        EXPECT_EQ(stand.mode(), Mode::Run);
        EXPECT_EQ(stand.events("hold"), 0);
    }
}

// After 2^32 ticks, a day at 50 kHz.
TEST(Wrap, OfTheTickCounterMovesNoPinAndNoWord) {
    for (uint64_t seed = first_seed(); seed < first_seed() + share_of(2); ++seed) {
        SCOPED_TRACE(seed);
        Findings findings;
        Play fresh(PlaySpec{seed, 5}, findings), old(PlaySpec{seed, 5}, findings);
        old.stand().count_ticks((1ull << 32) - 100000);
        fresh.run();
        old.run();
        EXPECT_EQ(old.stand().pins_hash(), fresh.stand().pins_hash());
        EXPECT_EQ(old.stand().words_hash(), fresh.stand().words_hash());
    }
}
