// Holding, starving, stopping and resuming: along the path, within the accelerations, and never by itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "motion.h"

using namespace gemelo;
using namespace rig;

namespace {

// Watches every slot: the path is not left, nothing jumps, and the limits hold.
struct Watch {
    Motion motion;
    double fastest = 0, hardest = 0, farthest = 0;
    double p[2] = {0, 0};
    std::deque<double> v[2] = {std::deque<double>(4), std::deque<double>(4)};  // of the last four slots

    void look(Rig& rig) {
        const double play = static_cast<double>(rig.device.machine().present().play_us) * 1e-6;
        for (uint8_t j = 0; j < 2; ++j) {
            const double position = rig.path(j), velocity = (position - p[j]) * 1000.0;
            // play_us is cut to whole microseconds; at 4000 steps/s that is 0.004 steps.
            farthest = std::max(farthest, std::fabs(position - motion.played(j, play)));
            fastest = std::max(fastest, std::fabs(velocity));
            hardest = std::max(hardest, std::fabs(velocity - v[j].front()) * 1000.0 / 4);
            p[j] = position;
            v[j].pop_front();
            v[j].push_back(velocity);
        }
    }
    void expect_good(Rig& rig) const {
        EXPECT_LE(farthest, 0.006) << "steps off the path";
        EXPECT_LE(fastest, 4000 * 1.01) << "steps/s";
        EXPECT_LE(hardest, 4000 * 1.1) << "steps/s^2, over 4 ms";
        EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
    }
};

const Motion kLong = quintic({0, 0}, {6000, -3500});

void play(Rig& rig, Feeder* feeder, Watch& watch, uint32_t ms, bool silent = false) {
    for (uint32_t i = 0; i < ms; ++i) {
        if (feeder != nullptr) feeder->feed(rig);
        rig.run_ms(1, silent);
        watch.look(rig);
    }
}

}  // namespace

TEST(Hold, SlowsAlongThePathAndResumesWhereItStood) {
    Rig rig;
    Watch watch{kLong};
    Feeder feeder(kLong, 7);
    play(rig, &feeder, watch, 1200);
    EXPECT_EQ(rig.command(Command::Hold), Code::Ok);
    EXPECT_EQ(rig.mode(), Mode::Hold);
    play(rig, &feeder, watch, 1500);
    EXPECT_EQ(rig.state().time_scale, 0);
    const int32_t stood = rig.steps(0);
    EXPECT_GT(stood, 500);
    EXPECT_LT(stood, 5500);
    play(rig, &feeder, watch, 3000);
    EXPECT_EQ(rig.steps(0), stood);
    EXPECT_EQ(rig.command(Command::Resume), Code::Ok);
    play(rig, &feeder, watch, 6000);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 6000);
    EXPECT_EQ(rig.steps(1), -3500);
    watch.expect_good(rig);
}

TEST(Hold, IsWithinTheAccelerationsWheneverItComes) {
    for (uint32_t when : {5u, 300u, 700u, 1100u, 1600u, 2000u, 2500u, 2900u}) {
        SCOPED_TRACE(when);
        Rig rig;
        Watch watch{kLong};
        Feeder feeder(kLong, 7);
        play(rig, &feeder, watch, when);
        rig.command(Command::Hold);
        play(rig, &feeder, watch, 300);
        rig.command(Command::Resume);
        play(rig, &feeder, watch, 6000);
        EXPECT_EQ(rig.steps(0), 6000);
        EXPECT_EQ(rig.steps(1), -3500);
        watch.expect_good(rig);
    }
}

TEST(Starvation, SlowsAlongThePathAndEndsExactlyOnTheLastKnot) {
    for (size_t knots : {3u, 20u, 40u, 60u, 90u, 120u, 145u}) {
        SCOPED_TRACE(knots);
        Rig rig;
        Watch watch{kLong};
        const size_t first = std::min<size_t>(knots, 100);
        ASSERT_EQ(rig.send(kLong.chunk(0, first, 0)).code, Code::Ok);
        play(rig, nullptr, watch, 600);
        if (first < knots) {
            ASSERT_EQ(rig.send(kLong.chunk(first, knots, 1)).code, Code::Ok);
        }
        play(rig, nullptr, watch, 6000);
        const Row last = kLong.row(knots - 1);
        EXPECT_EQ(rig.device.machine().present().position_q20[0], static_cast<int64_t>(last.position[0]) * 4096);
        EXPECT_EQ(rig.device.machine().present().position_q20[1], static_cast<int64_t>(last.position[1]) * 4096);
        EXPECT_EQ(rig.count_events("underrun"), 1);
        EXPECT_EQ(rig.mode(), Mode::Run);
        ASSERT_EQ(rig.send(kLong.chunk(knots, std::min(knots + 60, kLong.knots()), first < knots ? 2 : 1)).code,
                  Code::Ok);
        play(rig, nullptr, watch, 3000);
        EXPECT_EQ(rig.count_events("resumed"), 1);
        EXPECT_GT(rig.device.machine().present().play_us, (knots - 1) * 20000);
        watch.expect_good(rig);
    }
}

TEST(Starvation, ThatIsHeldEndsWithTheHoldAndIsNotSaidToBeOverBefore) {
    Rig rig;
    Watch watch{kLong};
    ASSERT_EQ(rig.send(kLong.chunk(0, 40, 0)).code, Code::Ok);
    play(rig, nullptr, watch, 3000);
    ASSERT_EQ(rig.count_events("underrun"), 1);
    const int32_t stood = rig.steps(0);
    EXPECT_EQ(rig.command(Command::Hold), Code::Ok);
    ASSERT_EQ(rig.send(kLong.chunk(40, kLong.knots(), 1)).code, Code::Ok);
    play(rig, nullptr, watch, 1000);
    EXPECT_EQ(rig.mode(), Mode::Hold);
    EXPECT_EQ(rig.steps(0), stood);
    EXPECT_EQ(rig.count_events("resumed"), 0);
    EXPECT_EQ(rig.command(Command::Resume), Code::Ok);
    play(rig, nullptr, watch, 6000);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 6000);
    EXPECT_EQ(rig.count_events("resumed"), 1);
    watch.expect_good(rig);
}

TEST(Starvation, DoesNotSlowAStreamThatIsFedFarEnoughAhead) {
    Rig rig;
    Watch watch{kLong};
    Feeder feeder(kLong, 7, 10, 0.9);
    for (int i = 0; i < 3400; ++i) {
        play(rig, &feeder, watch, 1);
        if (rig.mode() == Mode::Run && i > 5) {
            ASSERT_EQ(rig.device.machine().present().scale_q30, kFullScale) << "at " << i << " ms";
        }
    }
    EXPECT_EQ(rig.steps(0), 6000);
}

TEST(Heartbeat, LostWhileMovingHoldsAndNothingResumesByItself) {
    Rig rig;
    Watch watch{kLong};
    Feeder feeder(kLong, 7);
    play(rig, &feeder, watch, 1000);
    play(rig, &feeder, watch, 800, true);
    EXPECT_EQ(rig.mode(), Mode::Hold);
    EXPECT_NE(rig.event("hold").find("heartbeat"), std::string::npos);
    play(rig, &feeder, watch, 2000, true);
    const int32_t stood = rig.steps(0);
    play(rig, &feeder, watch, 3000);
    EXPECT_EQ(rig.mode(), Mode::Hold) << "beats alone resume nothing";
    EXPECT_EQ(rig.steps(0), stood);
    EXPECT_EQ(rig.command(Command::Resume), Code::Ok);
    play(rig, &feeder, watch, 6000);
    EXPECT_EQ(rig.steps(0), 6000);
    watch.expect_good(rig);
}

TEST(Heartbeat, LostAtRestIsHarmless) {
    Rig rig;
    rig.run_ms(5000, true);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.send(quintic({0, 0}, {50, 0}).whole()).code, Code::Ok);
    rig.run_ms(300, true);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 50);
}

TEST(Heartbeat, ThatIsRepeatedOrForAnotherBootIsNoSignOfLife) {
    for (const Bytes& beat : {build_heartbeat(5, 9), build_heartbeat(6, 1, kBoot + 1)}) {
        Rig rig;
        rig.device.receive(build_heartbeat(5, 9));
        ASSERT_EQ(rig.send(kLong.chunk(0, 100, 0)).code, Code::Ok);
        for (int i = 0; i < 8; ++i) {
            rig.device.receive(beat);
            rig.run_ms(100, true);
        }
        EXPECT_EQ(rig.mode(), Mode::Hold);
    }
}

TEST(Heartbeat, FromFarAheadDoesNotMakeThoseThatFollowLate) {
    Rig rig;
    Feeder feeder(kLong, 7);
    Watch watch{kLong};
    play(rig, &feeder, watch, 1000);
    rig.device.receive(build_heartbeat(1, 1u << 24));
    play(rig, &feeder, watch, 6000);
    EXPECT_EQ(rig.count_events("hold"), 0);
    EXPECT_EQ(rig.steps(0), 6000);
}

TEST(Heartbeat, CountsAgainAfterAnOutageOfAnyLength) {
    for (uint32_t minutes : {1u, 2u, 600u}) {
        Rig rig;
        rig.device.receive(build_heartbeat(5, 9));
        rig.device.stand_still(rig.device.now_us() + minutes * 60000000ull);
        const uint32_t counter = 9 + minutes * 600;
        ASSERT_EQ(rig.send(kLong.chunk(0, 100, 0)).code, Code::Ok);
        for (uint32_t i = 0; i < 8; ++i) {
            rig.device.receive(build_heartbeat(5, counter + i));
            rig.run_ms(100, true);
        }
        EXPECT_EQ(rig.mode(), Mode::Run) << minutes << " minutes";
    }
}

TEST(LateTicks, AreNotCaughtUpAndTheArmHoldsWhereTheHeartbeatWasLost) {
    Rig rig;
    Watch watch{kLong};
    Feeder feeder(kLong, 7);
    play(rig, &feeder, watch, 1200);
    const int32_t before = rig.steps(0);
    rig.device.stand_still(rig.device.now_us() + 2900000);
    rig.run_ms(1, true);
    rig.beat();
    rig.beat();
    rig.run_ms(1000);
    EXPECT_EQ(rig.mode(), Mode::Hold);
    EXPECT_EQ(rig.count_events("late"), 1);
    EXPECT_NE(rig.event("late").find("29"), std::string::npos) << rig.event("late");
    EXPECT_NE(rig.event("hold").find("heartbeat"), std::string::npos);
    EXPECT_LE(std::abs(rig.steps(0) - before), 2 * 4 + 1) << "no more than two slots at 4000 steps/s";
    rig.run_ms(3000);
    EXPECT_LE(std::abs(rig.steps(0) - before), 2 * 4 + 1);
    EXPECT_EQ(rig.state().velocity_q8[0], 0);
    EXPECT_EQ(rig.command(Command::Stop), Code::Ok);
    rig.run_ms(100);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_LE(std::abs(rig.steps(0) - before), 2 * 4 + 1);
    EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
}

TEST(LateTicks, OfLessThanAHeartbeatsPatienceGoOnAlongThePathFromRest) {
    Rig rig;
    Watch watch{kLong};
    Feeder feeder(kLong, 7);
    play(rig, &feeder, watch, 1200);
    rig.device.stand_still(rig.device.now_us() + 200000);
    rig.run_ms(1);
    Watch after{kLong};
    for (uint8_t j = 0; j < 2; ++j) after.p[j] = rig.path(j);
    play(rig, &feeder, after, 8000);
    EXPECT_EQ(rig.count_events("late"), 1);
    EXPECT_EQ(rig.count_events("hold"), 0);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 6000);
    EXPECT_EQ(rig.steps(1), -3500);
    after.expect_good(rig);
}

TEST(LateTicks, AtRestAreHarmless) {
    Rig rig;
    rig.device.stand_still(rig.device.now_us() + 2900000);
    rig.run_ms(10);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.count_events("late"), 0);
}

TEST(Stop, DeceleratesAlongThePathAndEndsTheStreamThere) {
    Rig rig;
    Watch watch{kLong};
    Feeder feeder(kLong, 7);
    play(rig, &feeder, watch, 1200);
    EXPECT_EQ(rig.command(Command::Stop), Code::Ok);
    EXPECT_EQ(rig.mode(), Mode::Hold);
    EXPECT_EQ(rig.send(kLong.chunk(100, 110, 99)).code, Code::NotReady);
    EXPECT_EQ(rig.command(Command::Resume), Code::NotReady);
    play(rig, nullptr, watch, 1500);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.count_events("stopped"), 1);
    EXPECT_EQ(rig.count_events("finished"), 0);
    watch.expect_good(rig);
    const double at0 = rig.path(0), at1 = rig.path(1);
    EXPECT_EQ(rig.steps(0), static_cast<int32_t>(std::floor(at0 + 0.5)));
    // A gateway knows whole steps only, and may start from there.
    const Motion back = quintic({std::floor(at0 + 0.5), std::floor(at1 + 0.5)}, {0, 0});
    Feeder feeder_back(back, 8);
    for (int i = 0; i < 1200; ++i) {
        feeder_back.feed(rig);
        rig.run_ms(5);
    }
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 0);
    EXPECT_EQ(rig.steps(1), 0);
}

TEST(Stop, WorksInAHoldAndInAStarvedStreamAndAtRest) {
    Rig held;
    held.send(kLong.chunk(0, 100, 0));
    held.run_ms(800);
    held.command(Command::Hold);
    held.run_ms(1500);
    EXPECT_EQ(held.command(Command::Stop), Code::Ok);
    held.run_ms(5);
    EXPECT_EQ(held.mode(), Mode::Idle);

    Rig starved;
    starved.send(kLong.chunk(0, 30, 0));
    starved.run_ms(3000);
    EXPECT_EQ(starved.count_events("underrun"), 1);
    EXPECT_EQ(starved.command(Command::Stop), Code::Ok);
    starved.run_ms(5);
    EXPECT_EQ(starved.mode(), Mode::Idle);
    EXPECT_EQ(starved.command(Command::Stop), Code::Ok);
    EXPECT_EQ(starved.mode(), Mode::Idle);
}

TEST(Hold, ThatReachesTheEndOfThePathFinishesThere) {
    Rig rig;
    const Motion motion = quintic({0, 0}, {300, 0});
    rig.send(motion.whole());
    rig.run_ms(static_cast<uint32_t>(motion.duration() * 1000) - 20);
    rig.command(Command::Hold);
    rig.run_ms(3000);
    if (rig.mode() == Mode::Hold) {
        rig.command(Command::Resume);
        rig.run_ms(1000);
    }
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_EQ(rig.steps(0), 300);
}
