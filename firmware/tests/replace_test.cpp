// REPLACE: the next knots and a full stop in one; taken from a knot that is to come, and nothing but the path is
// played.
#include <gtest/gtest.h>

#include "motion.h"
#include "steered.h"
#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

// A stream that has been steered to full speed for half a second, with a rest provided for.
struct Moving {
    Rig rig;
    Steered path{rig};
    SteeredWatch watch;

    Moving() {
        EXPECT_EQ(path.steer(1200, -800).code, Code::Ok);
        for (int i = 0; i < 10; ++i) run_and_steer(50, 1200, -800);
    }
    void run_ms(uint32_t ms, bool silent = false) { watch.run_ms(rig, path, ms, silent); }
    void run_and_steer(uint32_t ms, double v0, double v1) {
        run_ms(ms);
        ASSERT_EQ(path.steer(v0, v1).code, Code::Ok);
    }
    // The first knot that is at least so far ahead.
    size_t knot_ahead(uint64_t us) const {
        size_t knot = 0;
        while (path.time_us(knot) < path.played_us() + us) ++knot;
        return knot;
    }
    void expect_rest_at_the_end() {
        EXPECT_EQ(path.played_us(), path.end_us());
        for (uint8_t j = 0; j < 2; ++j) {
            EXPECT_EQ(rig.steps(j), (path.end().position[j] + 128) >> 8);
            EXPECT_EQ(rig.state().velocity_q8[j], 0);
        }
    }
    ~Moving() { watch.expect_good(rig); }
};

}  // namespace

TEST(Replacement, SteersAMovingArmWithoutASlowSlot) {
    Moving moving;
    for (double v : {900.0, -500.0, -1500.0, 0.0, 1800.0, 1800.0})
        for (int i = 0; i < 8; ++i) {
            moving.run_and_steer(33, v, -v / 2);
            EXPECT_EQ(moving.rig.device.machine().present().scale_q30, kFullScale);
        }
    EXPECT_EQ(moving.rig.state().underruns, 0u);
    EXPECT_EQ(moving.rig.count_events("underrun"), 0);
    EXPECT_EQ(moving.rig.count_events("started"), 1);
}

TEST(Replacement, ThatIsTheLastThatArrivesEndsInARestThatIsNoUnderRun) {
    Moving moving;
    moving.run_ms(2000);
    EXPECT_EQ(moving.rig.mode(), Mode::Run);
    moving.expect_rest_at_the_end();
    EXPECT_EQ(moving.rig.count_events("underrun"), 0);
    EXPECT_EQ(moving.rig.state().underruns, 0u);
}

TEST(Replacement, GoesOnFromTheRest) {
    Moving moving;
    moving.run_ms(2000);
    const int32_t stood = moving.rig.steps(0);
    for (int i = 0; i < 5; ++i) ASSERT_EQ(moving.path.steer(-1000, 1000).code, Code::Ok) << i, moving.run_ms(40);
    moving.run_ms(2000);
    EXPECT_LT(moving.rig.steps(0), stood - 40);
    moving.expect_rest_at_the_end();
    EXPECT_EQ(moving.rig.count_events("resumed"), 0) << "nothing had stopped";
}

TEST(Replacement, OfAKnotThatHasBeenPassedIsLateToTheSlot) {
    Moving moving;
    const size_t knot = moving.knot_ahead(10000);
    const ChunkSpec chunk = moving.path.message_from(knot, 500, 500);
    // The next slot is made already: the arm gets to the knot now, and the path is past it.
    while (moving.path.played_us() < moving.path.time_us(knot)) moving.run_ms(1);
    const Ack late = moving.rig.send(chunk);
    EXPECT_EQ(late.code, Code::Late);
    EXPECT_EQ(late.value, static_cast<int32_t>(moving.path.time_us(knot)));
    EXPECT_GT(late.limit, late.value);
    EXPECT_LE(late.limit, late.value + 2000);
    EXPECT_EQ(late.joint, kNoJoint);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, OfAKnotThatIsReachedInTheNextSlotIsTaken) {
    // The path stands on it.
    Moving moving;
    const size_t knot = moving.knot_ahead(10000);
    const ChunkSpec chunk = moving.path.message_from(knot, 500, 500);
    while (moving.path.played_us() + 1000 < moving.path.time_us(knot)) moving.run_ms(1);
    EXPECT_EQ(moving.path.send(chunk).code, Code::Ok);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, OfAnotherKnotThanTheDevicesIsRefused) {
    Moving moving;
    const size_t knot = moving.knot_ahead(20000);
    const ChunkSpec chunk = moving.path.message_from(knot, 500, 500);
    ChunkSpec between = chunk;
    between.replacing->from_us += 7000;
    const Ack ack = moving.rig.send(between);
    EXPECT_EQ(ack.code, Code::OtherKnot);
    EXPECT_EQ(ack.value, static_cast<int32_t>(chunk.seq));
    EXPECT_EQ(ack.limit, static_cast<int32_t>(ack.next_seq));
    ChunkSpec off = chunk;
    ++off.rows[0].position[1];
    EXPECT_EQ(moving.rig.send(off).code, Code::OtherKnot) << "by 1/256 step";
    off = chunk;
    --off.rows[0].velocity[0];
    EXPECT_EQ(moving.rig.send(off).code, Code::OtherKnot) << "by 1/256 step/s";
    ChunkSpec beyond = chunk;
    beyond.replacing->from_us = moving.path.end_us() + 20000;
    EXPECT_EQ(moving.rig.send(beyond).code, Code::OtherKnot) << "behind the path's end";
    EXPECT_EQ(moving.path.send(chunk).code, Code::Ok);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, IsTakenOnceAndANewerOneMakesItADuplicate) {
    Moving moving;
    const ChunkSpec eighth = moving.path.message(500, 500), ninth = [&moving] {
        ChunkSpec chunk = moving.path.message(700, 300);
        ++chunk.seq;
        return chunk;
    }();
    ASSERT_EQ(moving.path.send(ninth).code, Code::Ok);
    EXPECT_EQ(moving.rig.send(ninth).code, Code::Duplicate);
    const Ack ack = moving.rig.send(eighth);
    EXPECT_EQ(ack.code, Code::Duplicate);
    EXPECT_EQ(ack.next_seq, ninth.seq + 1);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, NeedsNoneOfThoseThatWereLost) {
    Moving moving;
    ChunkSpec chunk = moving.path.message(500, 500);
    chunk.seq += 8;
    const Ack ack = moving.path.send(chunk);
    EXPECT_EQ(ack.code, Code::Ok);
    EXPECT_EQ(ack.next_seq, chunk.seq + 1);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, ThatTheArmCouldNotStopOnIsRefusedAndThePathBeforeIsPlayedOn) {
    Moving moving;
    ChunkSpec chunk = moving.path.message(1200, -800);
    chunk.rows.resize(3);
    chunk.replacing->tail = 1;
    chunk.replacing->tail_dt_us = 20000;
    const Ack ack = moving.rig.send(chunk);
    EXPECT_EQ(ack.code, Code::NoStop);
    EXPECT_EQ(ack.limit, 1 << 26) << "played at full scale";
    EXPECT_GT(ack.value, 0);
    EXPECT_LT(ack.value, ack.limit);
    EXPECT_EQ(ack.next_seq, chunk.seq);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, FarAheadIsHeldAgainstWhatIsPlayedNow) {
    Moving moving;
    // 0.1 s further on the path the arm would still be at 1,200 steps/s, which takes it 0.3 s to stop.
    ChunkSpec chunk = moving.path.message_from(moving.knot_ahead(60000), 1200, -800);
    chunk.rows.resize(4);
    chunk.replacing->tail = 0;
    EXPECT_EQ(moving.rig.send(chunk).code, Code::NoStop);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, ThatEndsAtSpeedLateEnoughIsTakenAndEndsAsAnyQueue) {
    Moving moving;
    const Steered& path = moving.path;
    ChunkSpec chunk = moving.path.message(1200, -800, 30);
    chunk.rows.resize(31);
    chunk.replacing->tail = 0;
    ASSERT_EQ(moving.path.send(chunk).code, Code::Ok);
    moving.run_ms(3000);
    EXPECT_EQ(moving.rig.count_events("underrun"), 1);
    EXPECT_EQ(path.played_us(), path.end_us());
    EXPECT_EQ(moving.rig.steps(0), (path.end().position[0] + 128) >> 8);
    // From the knot it stands on, which is one at speed.
    EXPECT_EQ(moving.path.steer(1200, -800).code, Code::Ok);
    moving.run_ms(3000);
    EXPECT_EQ(moving.rig.count_events("resumed"), 1);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, AtALowerScaleMayEndSooner) {
    Moving moving;
    moving.rig.send_command(build_command(Command::Speed, 1000, {}, kNever, kBoot, 0, 300));
    moving.run_ms(100);
    ASSERT_EQ(moving.path.steer(1200, -800, 6).code, Code::Ok);
    ChunkSpec chunk = moving.path.message(1200, -800);
    chunk.rows.resize(4);
    chunk.replacing->tail = 0;
    EXPECT_EQ(moving.path.send(chunk).code, Code::Ok) << "at a tenth of the accelerations";
    moving.run_ms(1000);
    EXPECT_EQ(moving.rig.count_events("underrun"), 1);
}

TEST(Replacement, IsCheckedAsAnyChunk) {
    Moving moving;
    const ChunkSpec good = moving.path.message(500, 500);
    const auto code_of = [&moving, &good](auto&& change) {
        ChunkSpec chunk = good;
        change(chunk);
        return moving.rig.send(chunk).code;
    };
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.rows[2].velocity[0] = 4001 * 256; }), Code::VelocityLimit);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.rows[2].position[0] += 200 * 256; }), Code::VelocityLimit);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.rows[1].velocity[0] -= 300 * 256; }), Code::AccelerationLimit);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.rows[1].position[1] = 100001 * 256; }), Code::PositionLimit);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { ++chunk.boot_id; }), Code::WrongBoot);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.stream = 8; }), Code::WrongStream);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.first = true; }), Code::WrongStream);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.expires_us = 1; }), Code::Expired);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.dt_us = 999; }), Code::BadDt);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.replacing->tail_dt_us = 250001; }), Code::BadDt);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.rows.resize(1), chunk.replacing->tail = 0; }), Code::BadCount);
    EXPECT_EQ(code_of([](ChunkSpec& chunk) { chunk.replacing->tail = static_cast<uint16_t>(chunk.rows.size()); }),
              Code::BadCount);
    EXPECT_EQ(moving.rig.send(good, true).code, Code::Retained);
    EXPECT_EQ(moving.path.send(good).code, Code::Ok);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
    EXPECT_EQ(moving.rig.state().refused, 13u);
}

TEST(Replacement, NamesTheKnotThatItIsRefusedFor) {
    Moving moving;
    ChunkSpec chunk = moving.path.message(500, 500);
    chunk.rows.back().position[1] += 20;
    chunk.rows.back().velocity[1] = 4001 * 256;
    const Ack ack = moving.rig.send(chunk);
    EXPECT_EQ(ack.joint, 1);
    EXPECT_EQ(ack.knot, chunk.rows.size() - 1);
    EXPECT_EQ(ack.value, 4001 * 256);
}

TEST(Replacement, ThatIsCutShortIsRefusedByItsLength) {
    Moving moving;
    Bytes frame = build(moving.path.message(500, 500));
    for (size_t size : {32u, 40u, 47u, 48u, 63u}) {
        const Bytes part(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_EQ(moving.rig.send(seal(part)).code, Code::BadCount) << size;
    }
}

TEST(Replacement, HasTheSpaceOfWhatItReplaces) {
    DeviceConfig config = two_joints();
    config.queue_capacity = 40;
    Rig rig(config);
    Steered path(rig);
    ASSERT_EQ(path.steer(600, 600, 30).code, Code::Ok);
    rig.run_ms(30);
    const Ack full = rig.send(path.message(600, 600, 34, 30000));
    EXPECT_EQ(full.code, Code::NoSpace);
    EXPECT_GT(full.value, full.limit);
    const ChunkSpec chunk = path.message(600, 600, 20);
    const Ack ack = path.send(chunk);
    EXPECT_EQ(ack.code, Code::Ok);
    EXPECT_GT(chunk.rows.size(), 40u - 35u) << "more than was free";
    EXPECT_GE(ack.credits, 40u - chunk.rows.size() - 1);
}

TEST(Replacement, MayEndTheStream) {
    Moving moving;
    ChunkSpec chunk = moving.path.message(1500, 200);
    chunk.last = true;
    EXPECT_EQ(moving.path.send(chunk).code, Code::Ok);
    while (moving.rig.mode() == Mode::Run) moving.run_ms(1);
    EXPECT_EQ(moving.rig.mode(), Mode::Idle);
    EXPECT_EQ(moving.rig.count_events("finished"), 1);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, ThatEndsTheStreamEndsAtRest) {
    Moving moving;
    ChunkSpec chunk = moving.path.message(1200, -800, 30);
    chunk.rows.resize(31);
    chunk.replacing->tail = 0;
    chunk.last = true;
    const Ack ack = moving.rig.send(chunk);
    EXPECT_EQ(ack.code, Code::NotAtRest);
    EXPECT_EQ(ack.knot, 30);
}

TEST(Replacement, MayReplaceALastKnotThatHasNotBeenReached) {
    Moving moving;
    ChunkSpec last = moving.path.message(1500, 200);
    last.last = true;
    ASSERT_EQ(moving.path.send(last).code, Code::Ok);
    moving.run_ms(30);
    EXPECT_EQ(moving.path.steer(-900, 900).code, Code::Ok);
    moving.run_ms(3000);
    EXPECT_EQ(moving.rig.mode(), Mode::Run) << "the stream has no end any more";
    EXPECT_EQ(moving.rig.count_events("finished"), 0);
    moving.expect_rest_at_the_end();
}

// The path is at its end two slots before the arm, and `finished` is said, is.
TEST(Replacement, OfALastKnotThatHasBeenReachedIsLateAndThenOfAStreamThatIsOver) {
    Moving moving;
    ChunkSpec last = moving.path.message(1500, 200);
    last.last = true;
    ASSERT_EQ(moving.path.send(last).code, Code::Ok);
    const ChunkSpec on = moving.path.message_from(moving.path.knots() - 1, 500, 500);
    while (moving.path.played_us() + 1000 < moving.path.end_us()) moving.run_ms(1);
    ASSERT_EQ(moving.rig.mode(), Mode::Run);
    EXPECT_EQ(moving.rig.send(on).code, Code::Late);
    while (moving.rig.mode() == Mode::Run) moving.run_ms(1);
    EXPECT_EQ(moving.rig.send(on).code, Code::WrongStream);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, OpensAStreamThatMayRest) {
    Rig rig;
    Steered path(rig);
    EXPECT_EQ(path.steer(300, 0).code, Code::Ok);
    rig.run_ms(1500);
    EXPECT_EQ(rig.mode(), Mode::Run);
    EXPECT_EQ(path.played_us(), path.end_us());
    EXPECT_EQ(rig.send(path.message_from(0, 300, 0)).code, Code::Late);
    Steered other(rig, 8);
    EXPECT_EQ(other.steer(300, 0).code, Code::NotReady) << "a stream is open";
}

TEST(Replacement, OfAStreamWhoseFirstChunkNeverCameIsAGap) {
    Rig rig;
    Steered path(rig);
    ChunkSpec chunk = path.message(300, 0);
    chunk.first = false;
    chunk.seq = 3;
    const Ack ack = rig.send(chunk);
    EXPECT_EQ(ack.code, Code::Gap);
    EXPECT_EQ(ack.next_seq, 0u);
}

TEST(Chunk, WithoutReplaceGoesOnBehindAPathThatEndsAtSpeedAndNotBehindARest) {
    Moving moving;
    ChunkSpec behind = moving.path.message(500, 500);
    behind.rows.erase(behind.rows.begin());
    behind.replacing.reset();
    EXPECT_EQ(moving.rig.send(behind).code, Code::WrongStream);
    ChunkSpec open = moving.path.message(1200, -800, 30);
    open.rows.resize(31);
    open.replacing->tail = 0;
    ASSERT_EQ(moving.path.send(open).code, Code::Ok);
    ChunkSpec rest = moving.path.message_from(moving.path.knots() - 1, 1200, -800);
    rest.rows.erase(rest.rows.begin());
    rest.replacing.reset();
    rest.dt_us = 40000;
    rest.last = true;
    ++rest.seq;
    EXPECT_EQ(moving.rig.send(rest).code, Code::Gap);
    --rest.seq;
    rest.rows[0] = open.rows.back();  // on at the same speed for 40 ms
    for (size_t j = 0; j < 2; ++j) rest.rows[0].position[j] += rest.rows[0].velocity[j] / 25;
    rest.rows.resize(1);
    rest.last = false;
    EXPECT_EQ(moving.path.send(rest).code, Code::Ok);
    EXPECT_EQ(moving.rig.ack->next_seq, rest.seq + 1);
    moving.run_ms(3000);
    EXPECT_EQ(moving.rig.count_events("underrun"), 1);
}

TEST(Replacement, IsTakenInAHoldAndPlayedAfterIt) {
    Moving moving;
    ASSERT_EQ(moving.rig.command(Command::Hold), Code::Ok);
    moving.run_ms(20);
    EXPECT_EQ(moving.path.steer(-500, 1500).code, Code::Ok) << "while it slows";
    moving.run_ms(1000);
    const int32_t stood = moving.rig.steps(0);
    EXPECT_EQ(moving.path.steer(-900, 900).code, Code::Ok) << "while it stands";
    moving.run_ms(500);
    EXPECT_EQ(moving.rig.mode(), Mode::Hold);
    EXPECT_EQ(moving.rig.steps(0), stood);
    ASSERT_EQ(moving.rig.command(Command::Resume), Code::Ok);
    moving.run_ms(3000);
    EXPECT_EQ(moving.rig.mode(), Mode::Run);
    moving.expect_rest_at_the_end();
}

TEST(Replacement, IsNotTakenWhileAStopDecelerates) {
    Moving moving;
    ASSERT_EQ(moving.rig.command(Command::Stop), Code::Ok);
    moving.run_ms(20);
    EXPECT_EQ(moving.path.steer(500, 500).code, Code::NotReady);
    moving.run_ms(1500);
    EXPECT_EQ(moving.rig.mode(), Mode::Idle);
    EXPECT_EQ(moving.rig.count_events("stopped"), 1);
    EXPECT_EQ(moving.path.steer(500, 500).code, Code::WrongStream) << "nothing resumes by itself";
}

TEST(Replacement, ThatRestsIsEndedByAStop) {
    Moving moving;
    moving.run_ms(2000);
    ASSERT_EQ(moving.rig.command(Command::Stop), Code::Ok);
    moving.run_ms(5);
    EXPECT_EQ(moving.rig.mode(), Mode::Idle);
    Steered next(moving.rig, 8);
    EXPECT_EQ(next.steer(300, 300).code, Code::Ok);
}

TEST(Replacement, IsPlayedAtAnyTimeScale) {
    Moving moving;
    uint32_t id = 2000;
    for (uint16_t permil : {500, 1000, 100, 0, 1000, 730}) {
        moving.rig.send_command(build_command(Command::Speed, ++id, {}, kNever, kBoot, 0, permil));
        for (int i = 0; i < 10; ++i) moving.run_and_steer(33, i < 5 ? 1500 : -1500, 700);
    }
    moving.run_ms(4000);
    moving.expect_rest_at_the_end();
}

// Steers once more, half a second before the tail, and falls silent.
TEST(Heartbeat, LostInATailLeavesItToBrakeAndHoldsAtItsEnd) {
    Moving moving;
    ASSERT_EQ(moving.path.steer(1200, -800, 20).code, Code::Ok);  // 0.4 s, and another 0.4 s to rest
    moving.rig.beat();
    moving.run_ms(510, true);
    EXPECT_GT(moving.path.end_us(), moving.path.played_us() + 100000);
    EXPECT_EQ(moving.rig.mode(), Mode::Run) << "in the tail";
    EXPECT_EQ(moving.rig.device.machine().present().scale_q30, kFullScale);
    moving.run_ms(1000, true);
    EXPECT_EQ(moving.rig.mode(), Mode::Hold) << "at rest";
    moving.expect_rest_at_the_end();
    EXPECT_EQ(moving.path.steer(500, 500).code, Code::Ok);
    moving.run_ms(300);
    EXPECT_EQ(moving.rig.mode(), Mode::Hold) << "beats alone resume nothing";
    ASSERT_EQ(moving.rig.command(Command::Resume), Code::Ok);
    moving.run_ms(2000);
    moving.expect_rest_at_the_end();
}

TEST(Heartbeat, LostBeforeTheTailHolds) {
    Moving moving;
    ASSERT_EQ(moving.path.steer(1200, -800, 60).code, Code::Ok);
    moving.rig.beat();
    moving.run_ms(500, true);
    EXPECT_EQ(moving.rig.mode(), Mode::Run);
    moving.run_ms(5, true);
    EXPECT_EQ(moving.rig.mode(), Mode::Hold);
    EXPECT_NE(moving.rig.event("hold").find("heartbeat"), std::string::npos);
}

// Whatever is called a tail: the arm of a silent gateway rests within seconds.
TEST(Heartbeat, LostInALongTailHoldsUntilThreeSecondsBeforeItsEnd) {
    for (size_t knots : {86u, 90u}) {  // of 40 ms: at half a second of silence 2.94 and 3.1 s are left
        SCOPED_TRACE(knots);
        Rig rig;
        Steered path(rig);
        ChunkSpec chunk = path.message(100, 0, knots - 1);
        for (size_t k = 1; k < chunk.rows.size(); ++k)
            chunk.rows[k].position[0] =
                chunk.rows[k - 1].position[0] + (chunk.rows[k - 1].velocity[0] + chunk.rows[k].velocity[0]) / 50;
        ASSERT_EQ(chunk.rows.size(), knots + 1);
        chunk.replacing->tail = static_cast<uint16_t>(knots);
        ASSERT_EQ(path.send(chunk).code, Code::Ok);
        rig.run_ms(505, true);
        EXPECT_EQ(rig.mode(), knots == 86 ? Mode::Run : Mode::Hold);
    }
}

TEST(Heartbeat, LostInATailThatIsPlayedSlowlyHolds) {
    Moving moving;
    moving.rig.send_command(build_command(Command::Speed, 3000, {}, kNever, kBoot, 0, 200));
    moving.run_ms(300);
    ASSERT_EQ(moving.path.steer(1200, -800, 1).code, Code::Ok);
    moving.rig.beat();
    moving.run_ms(510, true);
    EXPECT_EQ(moving.rig.mode(), Mode::Hold);
    EXPECT_GT(moving.path.end_us(), moving.path.played_us());
}

TEST(EStop, ForgetsAPathThatIsReplaced) {
    Wired wired(open_field(), {0, 0}, true);
    ChunkSpec chunk;
    chunk.first = true;
    chunk.dt_us = 100000;
    chunk.replacing = Replacing{0, 1, 100000};
    chunk.rows = {Row{{0, 0}, {0, 0}}, Row{{256 * 20, 0}, {256 * 400, 0}}, Row{{256 * 40, 0}, {0, 0}}};
    ASSERT_EQ(wired.send(chunk), Code::Ok);
    wired.run_ms(120);
    wired.press(kButton);
    wired.run_ms(2);
    const uint64_t pulses = wired.pulses;
    chunk.first = false;
    chunk.seq = 1;
    chunk.replacing->from_us = 200000;
    chunk.rows = {chunk.rows[2], chunk.rows[2]};
    EXPECT_EQ(wired.send(chunk), Code::NotReady);
    wired.press(kButton, Finger::Off);
    wired.run_ms(500);
    EXPECT_EQ(wired.pulses, pulses);
    ASSERT_EQ(wired.command(Command::Reset), Code::Ok);
    EXPECT_EQ(wired.send(chunk), Code::NotReady) << "unreferenced";
}
