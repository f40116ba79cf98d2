// The servo of a gripper: its pulse goes to its target at its speed, and stops where people are told that it does.
#include <gtest/gtest.h>

#include "bytes.h"
#include "horn.h"
#include "motion.h"

using namespace gemelo;
using namespace rig;

namespace {

// 1000 to 2000 us in half a second.
DeviceConfig with_servo() {
    DeviceConfig config = two_joints();
    config.servo = ServoConfig{"jaws", 40, 1000, 2000, 2000, 0};  // name, pin, lower, upper, speed, off at an e-stop
    return config;
}

Bytes turn(uint16_t pulse_us) {
    static uint32_t id = 1000;
    return build_command(Command::Servo, ++id, {}, kNever, kBoot, 0, pulse_us);
}

uint16_t pulse_of(Rig& rig) { return rig.device.machine().servo().pulse_us(); }

// At 2000 us, its way there behind it.
void open_jaws(Rig& rig) {
    ASSERT_EQ(rig.send_command(turn(2000)), Code::Ok);
    rig.run_ms(5);
    ASSERT_EQ(pulse_of(rig), 2000);
}

}  // namespace

TEST(Servo, HasNoPulsesBeforeItsFirstCommand) {
    Rig rig(with_servo());
    rig.run_ms(100);
    EXPECT_EQ(pulse_of(rig), 0);
    ASSERT_EQ(rig.send_command(turn(1500)), Code::Ok);
    rig.run_ms(2);
    EXPECT_EQ(pulse_of(rig), 1500) << "there is no place to come from";
}

TEST(Servo, GoesToItsTargetAtItsSpeed) {
    Rig rig(with_servo());
    open_jaws(rig);
    ASSERT_EQ(rig.send_command(turn(1000)), Code::Ok);
    rig.run_ms(250);
    EXPECT_NEAR(pulse_of(rig), 1500, 3);
    rig.run_ms(253);
    EXPECT_EQ(pulse_of(rig), 1000);
    rig.run_ms(100);
    EXPECT_EQ(pulse_of(rig), 1000);
}

TEST(Servo, SlowlyIsAsExactAsQuickly) {
    DeviceConfig config = with_servo();
    config.servo.speed_us_s = 10;
    Rig rig(config);
    open_jaws(rig);
    ASSERT_EQ(rig.send_command(turn(1000)), Code::Ok);
    for (int beat = 0; beat < 100; ++beat) rig.run_ms(100);
    EXPECT_NEAR(pulse_of(rig), 1900, 1);
}

TEST(Servo, IsToldInTheStateOfADeviceThatHasOne) {
    Rig rig(with_servo()), bare;
    open_jaws(rig);
    ASSERT_EQ(rig.send_command(turn(1000)), Code::Ok);
    const auto last_state = [](Rig& of) {
        of.device.advance(of.device.now_us() + 100000);
        Bytes found;
        for (const OutFrame& frame : of.device.outputs())
            if (frame.output == Output::State) found = frame.payload;
        return found;
    };
    const Bytes said = last_state(rig), shorter = last_state(bare);
    ASSERT_EQ(said.size(), shorter.size() + 4);
    EXPECT_NEAR(load_u16(&said[60 + 16]), 1800, 45);
    EXPECT_EQ(load_u16(&said[60 + 16 + 2]), 1000);
}

TEST(Servo, StopsWhereItIsOnAStopAndAHold) {
    for (const Command command : {Command::Stop, Command::Hold}) {
        Rig rig(with_servo());
        open_jaws(rig);
        ASSERT_EQ(rig.send_command(turn(1000)), Code::Ok);
        rig.run_ms(200);
        EXPECT_EQ(rig.command(command), Code::Ok);
        const uint16_t stopped = pulse_of(rig);
        rig.run_ms(500);
        EXPECT_EQ(pulse_of(rig), stopped);
        EXPECT_NEAR(stopped, 1600, 10);
    }
}

TEST(Servo, StaysWhereItIsWhenItIsToldTo) {
    Rig rig(with_servo());
    open_jaws(rig);
    ASSERT_EQ(rig.send_command(turn(1000)), Code::Ok);
    rig.run_ms(200);
    EXPECT_EQ(rig.send_command(build_command(Command::Servo, 77, {}, kNever, kBoot, 1, 0)), Code::Ok);
    rig.run_ms(500);
    EXPECT_NEAR(pulse_of(rig), 1600, 10);
    EXPECT_EQ(rig.send_command(build_command(Command::Servo, 78, {}, kNever, kBoot, 1, 1000)), Code::BadArgument);
    EXPECT_EQ(rig.send_command(build_command(Command::Servo, 79, {}, kNever, kBoot, 2, 1000)), Code::BadArgument);
}

TEST(Servo, RefusesWhatItCannotDo) {
    Rig rig(with_servo()), bare;
    EXPECT_EQ(bare.send_command(turn(1500)), Code::BadArgument);
    EXPECT_EQ(rig.send_command(turn(999)), Code::PositionLimit);
    EXPECT_EQ(rig.send_command(turn(2001)), Code::PositionLimit);
    EXPECT_EQ(rig.send_command(turn(0)), Code::PositionLimit);
    rig.run_ms(10);
    EXPECT_EQ(pulse_of(rig), 0);
}

TEST(Servo, StopsWithoutAHeartbeatAndKeepsItsHold) {
    DeviceConfig config = with_servo();
    config.servo.speed_us_s = 500;
    Rig rig(config);
    open_jaws(rig);
    ASSERT_EQ(rig.send_command(turn(1000)), Code::Ok);
    rig.device.advance(rig.device.now_us() + 3000000);
    EXPECT_NEAR(pulse_of(rig), 2000 - 500 * config.hold_timeout_ms / 1000, 60);
}

namespace {

// The e-stop of with_servo(), pressed half way.
uint16_t pulse_after_estop(bool is_off_at_estop) {
    DeviceConfig config = with_servo();
    config.servo.is_off_at_estop = is_off_at_estop;
    config.inputs = 1;
    config.input[0] = InputConfig{"estop", 21, InputRole::EStop, kNone, 0, Pull::None};
    Rig rig(config);
    open_jaws(rig);
    EXPECT_EQ(rig.send_command(turn(1000)), Code::Ok);
    rig.run_ms(200);
    rig.device.world().press(0, Press::Held);
    rig.run_ms(300);
    EXPECT_EQ(rig.send_command(turn(1500)), Code::EstopPressed);
    return pulse_of(rig);
}

}  // namespace

TEST(Servo, HoldsWhatItHasAtAnEstopUnlessItIsToLetGo) {
    EXPECT_NEAR(pulse_after_estop(false), 1600, 10);
    EXPECT_EQ(pulse_after_estop(true), 0);
}

TEST(Horn, FollowsAtItsSpeedAndStopsAtAnObject) {
    for (const bool closes_downwards : {true, false}) {
        const double open = closes_downwards ? 2000 : 1000, closed = closes_downwards ? 1000 : 2000;
        Horn horn;
        horn.begin(HornConfig{1000, open, closed, 50, 0, 0});
        EXPECT_EQ(horn.value(), 50);
        horn.advance(static_cast<uint32_t>(closed), 0.25);
        EXPECT_NEAR(horn.value(), 37.5, 1e-9);
        horn.put_object(1500);
        horn.advance(static_cast<uint32_t>(closed), 2);
        EXPECT_NEAR(horn.value(), 25, 1e-9);
        horn.advance(static_cast<uint32_t>(open), 2);
        EXPECT_NEAR(horn.value(), 50, 1e-9) << "it holds nothing back on the way out";
        horn.take_object();
        horn.advance(static_cast<uint32_t>(closed), 2);
        EXPECT_NEAR(horn.value(), 0, 1e-9);
        horn.advance(0, 2);
        EXPECT_NEAR(horn.value(), 0, 1e-9) << "without pulses it stays";
    }
}
