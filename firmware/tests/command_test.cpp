// Commands: once each, in their time, for this boot; and the clock's question.
#include <gtest/gtest.h>

#include "bytes.h"
#include "motion.h"

using namespace gemelo;
using namespace rig;

TEST(Command, ThatIsRepeatedIsAnsweredAgainAndNotDoneAgain) {
    Rig rig;
    const Motion motion = quintic({0, 0}, {3000, 0});
    rig.send(motion.whole());
    rig.run_ms(600);
    const Bytes hold = build_command(Command::Hold, 41), resume = build_command(Command::Resume, 42);
    EXPECT_EQ(rig.send_command(hold), Code::Ok);
    rig.run_ms(1000);
    EXPECT_EQ(rig.send_command(resume), Code::Ok);
    EXPECT_EQ(rig.send_command(hold), Code::Ok);
    EXPECT_EQ(rig.mode(), Mode::Run) << "the old hold is not done again";
    EXPECT_EQ(rig.count_events("hold"), 1);
    rig.run_until_idle();
    EXPECT_EQ(rig.steps(0), 3000);
}

TEST(Command, UnderTheIdOfAnotherIsDoneAllTheSame) {
    Rig rig;
    rig.send(quintic({0, 0}, {3000, 0}).whole());
    rig.run_ms(600);
    EXPECT_EQ(rig.send_command(build_command(Command::Speed, 41, {}, kNever, kBoot, 0, 1000)), Code::Ok);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 41)), Code::Ok);
    rig.run_ms(2000);
    EXPECT_EQ(rig.mode(), Mode::Idle);
    EXPECT_LT(rig.steps(0), 3000);
}

namespace {

// Since it was asked last.
int count_statuses(Rig& rig) {
    int count = 0;
    for (const OutFrame& frame : rig.device.outputs()) count += frame.output == Output::Status;
    rig.device.outputs().clear();
    return count;
}

}  // namespace

TEST(Status, IsSaidOnRequestAndNowAndThen) {
    Rig rig;
    rig.device.receive(build_command(Command::Status, 1));
    EXPECT_EQ(count_statuses(rig), 1);
    rig.device.advance(rig.device.now_us() + 9900000);
    EXPECT_EQ(count_statuses(rig), 0);
    rig.device.advance(rig.device.now_us() + 30200000);
    EXPECT_EQ(count_statuses(rig), 4);
}

TEST(Status, OfADeviceWithoutAConfigurationIsSaidToo) {
    DeviceConfig none{};
    Rig rig(none, false);
    rig.device.receive(build_command(Command::Status, 1));
    EXPECT_EQ(count_statuses(rig), 1);
    rig.device.advance(rig.device.now_us() + 30100000);
    EXPECT_EQ(count_statuses(rig), 3);
}

TEST(Command, ThatWasRefusedIsRefusedAgainThoughItCouldBeDoneNow) {
    Rig rig;
    const Bytes resume = build_command(Command::Resume, 9);
    EXPECT_EQ(rig.send_command(resume), Code::NotReady);
    rig.send(quintic({0, 0}, {3000, 0}).whole());
    rig.run_ms(300);
    rig.command(Command::Hold);
    EXPECT_EQ(rig.send_command(resume), Code::NotReady);
    EXPECT_EQ(rig.mode(), Mode::Hold);
}

TEST(Command, OfAStaleLifeOrTimeDoesNothing) {
    Rig rig;
    rig.send(quintic({0, 0}, {3000, 0}).whole());
    rig.run_ms(300);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 1, {}, kNever, kBoot + 1)), Code::WrongBoot);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 2, {}, 299999)), Code::Expired);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 3), true), Code::Retained);
    EXPECT_EQ(rig.mode(), Mode::Run);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 3)), Code::Ok)
        << "the retained one was not counted as done";
}

TEST(Command, ThatStopsIsTakenByWhateverBootIsThere) {
    Rig rig;
    rig.send(quintic({0, 0}, {3000, 0}).whole());
    rig.run_ms(300);
    EXPECT_EQ(rig.send_command(build_command(Command::Resume, 1, {}, kNever, 0)), Code::WrongBoot);
    EXPECT_EQ(rig.send_command(build_command(Command::Disarm, 2, {}, kNever, 0)), Code::NotReady);
    EXPECT_EQ(rig.send_command(build_command(Command::Hold, 3, {}, kNever, 0)), Code::Ok);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 4, {}, kNever, 0)), Code::Ok);
    EXPECT_EQ(rig.send_command(build_command(Command::Stop, 5, {}, kNever, 0), true), Code::Retained);
    EXPECT_EQ(rig.mode(), Mode::Hold);
    rig.run_until_idle();
    EXPECT_EQ(rig.send_command(build_command(Command::Disarm, 6, {}, kNever, 0)), Code::Ok);
}

TEST(Reference, IsTakenAtRestOnly) {
    Rig rig;
    rig.send(quintic({0, 0}, {3000, 0}).whole());
    rig.run_ms(300);
    EXPECT_EQ(rig.command(Command::Reference, {0, 0}), Code::NotReady);
    rig.run_until_idle();
    EXPECT_EQ(rig.command(Command::Reference, {100001 * 256, 0}), Code::PositionLimit);
    EXPECT_EQ(rig.command(Command::Reference, {0}), Code::BadJoints);
    EXPECT_EQ(rig.command(Command::Reference, {-7 * 256, 128}), Code::Ok);
    EXPECT_EQ(rig.steps(0), -7);
    EXPECT_EQ(rig.steps(1), 1);
    EXPECT_EQ(rig.count_events("referenced"), 1);
    rig.run_ms(50);
    EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
}

TEST(Sync, IsAnsweredWithTheTimesOfReceiptAndAnswer) {
    Rig rig;
    rig.run_ms(1234);
    const Bytes question = build_sync(0x1122334455667788);
    rig.device.receive(question.data(), question.size(), false, rig.device.now_us() - 30);
    const OutFrame answer = rig.device.outputs().back();
    ASSERT_EQ(answer.output, Output::SyncReply);
    EXPECT_EQ(load_u64(&answer.payload[8]), 0x1122334455667788u);
    EXPECT_EQ(load_u64(&answer.payload[16]), 1233970u);
    EXPECT_EQ(load_u64(&answer.payload[24]), 1234000u);
}

TEST(State, IsSaidFiftyTimesASecondAndTellsSpeedAndPlace) {
    Rig rig;
    const Motion motion = quintic({0, 0}, {3000, -1500});
    rig.send(motion.whole());
    rig.run_ms(700);
    const State& state = rig.state();
    const double t = static_cast<double>(state.play_us) * 1e-6;
    EXPECT_EQ(state.mode, Mode::Run);
    EXPECT_EQ(state.time_scale, 32768);
    EXPECT_NEAR(state.steps[0], motion.joints[0].position(t), 0.51);
    EXPECT_NEAR(state.velocity_q8[1] / 256.0, motion.joints[1].velocity(t), 3.0);
    rig.device.outputs().clear();
    rig.device.advance(rig.device.now_us() + 1000000);
    int states = 0;
    for (const OutFrame& frame : rig.device.outputs()) states += frame.output == Output::State;
    EXPECT_EQ(states, 50);
}
