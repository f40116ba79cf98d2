// SPEED: a bound of the time scale along the path, at any time, within the accelerations.
#include <gtest/gtest.h>

#include <random>

#include "motion.h"
#include "wired.h"

using namespace gemelo;
using namespace rig;

namespace {

DeviceConfig quintic_field() {
    DeviceConfig config = open_field();
    for (JointConfig& joint : config.joint) joint.max_acceleration_q8 = 4000 * 256;  // as quintic() has it
    return config;
}

const Motion kLong = quintic({0, 0}, {6000, -3500});

// Plays kLong, fed a second ahead, and watches that the path is not left.
struct Player {
    Wired wired{quintic_field(), {0, 0}, true};
    size_t next = 0;
    uint32_t seq = 0;
    double farthest = 0;

    void feed() {
        const double played_s = static_cast<double>(wired.machine.present().play_us) * 1e-6;
        while (next < kLong.knots() && (next == 0 || static_cast<double>(next) * kLong.dt < played_s + 1.0)) {
            const size_t end = std::min(next + 10, kLong.knots());
            if (wired.send(kLong.chunk(next, end, seq)) != Code::Ok) return;
            next = end;
            ++seq;
        }
    }
    void run_ms(uint32_t ms, bool is_fed = true) {
        for (uint32_t i = 0; i < ms; ++i) {
            if (is_fed) feed();
            wired.run_ms(1);
            const double play_s = static_cast<double>(wired.machine.present().play_us) * 1e-6;
            for (uint8_t j = 0; j < 2; ++j)
                farthest = std::max(farthest, std::fabs(wired.path(j) - kLong.played(j, play_s)));
        }
    }
    double scale() const { return wired.machine.present().scale_q30 / 1073741824.0; }
    void expect_good() const {
        EXPECT_LE(farthest, 0.006) << "steps off the path";
        for (size_t j = 0; j < 2; ++j) {
            EXPECT_LE(wired.fastest(j), 4000 * 1.01);
            EXPECT_LE(wired.hardest(j), 4000 * 1.1);
        }
        EXPECT_LE(wired.machine.max_slot_error_q8(), 128u);
    }
    void expect_end() const {
        EXPECT_EQ(wired.machine.mode(), Mode::Idle);
        EXPECT_EQ(wired.shaft[0], 6000);
        EXPECT_EQ(wired.shaft[1], -3500);
    }
};

}  // namespace

TEST(Speed, IsTheTimeScaleThatIsReached) {
    for (uint16_t permil : {250, 500, 999}) {
        Player player;
        EXPECT_EQ(player.wired.command(Command::Speed, permil), Code::Ok);
        player.run_ms(1500);
        EXPECT_NEAR(player.scale(), permil / 1000.0, 1e-6);
        EXPECT_EQ(load_u16(&player.wired.state[58]), permil);
        player.run_ms(15000);
        player.expect_end();
        player.expect_good();
    }
}

TEST(Speed, ChangesAtAnyTimeWithinTheAccelerations) {
    for (uint32_t when : {5u, 300u, 700u, 1100u, 1600u, 2000u, 2500u}) {
        SCOPED_TRACE(when);
        Player player;
        player.run_ms(when);
        player.wired.command(Command::Speed, 300);
        player.run_ms(800);
        player.wired.command(Command::Speed, 1000);
        player.run_ms(12000);
        player.expect_end();
        player.expect_good();
    }
}

TEST(Speed, AtZeroStandsOnThePathInRunAndGoesOnAfter) {
    Player player;
    player.run_ms(1200);
    player.wired.command(Command::Speed, 0);
    player.run_ms(1500);
    EXPECT_EQ(player.wired.machine.mode(), Mode::Run);
    EXPECT_EQ(player.scale(), 0.0);
    const int32_t stood = player.wired.shaft[0];
    player.run_ms(1000);
    EXPECT_EQ(player.wired.shaft[0], stood);
    EXPECT_EQ(player.wired.count_events("underrun"), 0) << "knots are there";
    player.wired.command(Command::Speed, 700);
    player.run_ms(9000);
    player.expect_end();
    player.expect_good();
}

TEST(Speed, AtZeroFromTheStartMovesNothing) {
    Player player;
    player.wired.command(Command::Speed, 0);
    player.run_ms(1000);
    EXPECT_EQ(player.wired.pulses, 0u);
    player.wired.command(Command::Speed, 1000);
    player.run_ms(8000);
    player.expect_end();
    player.expect_good();
}

TEST(Speed, HoldsStarvationAndResumeMixWithoutLeavingThePath) {
    std::mt19937 random(37);
    for (int i = 0; i < 12; ++i) {
        SCOPED_TRACE(i);
        Player player;
        for (int n = 0; n < 12; ++n) {
            switch (random() % 4) {
                case 0:
                    player.wired.command(Command::Speed, static_cast<uint16_t>(random() % 1001));
                    break;
                case 1:
                    player.wired.command(Command::Hold);
                    break;
                case 2:
                    player.wired.command(Command::Resume);
                    break;
                default:
                    player.run_ms(random() % 1500, false);
            }
            player.run_ms(random() % 700);
        }
        player.wired.command(Command::Resume);
        player.wired.command(Command::Speed, 1000);
        player.run_ms(12000);
        player.expect_end();
        player.expect_good();
    }
}

TEST(Speed, AtZeroCanBeStoppedAndHeld) {
    Player player;
    player.run_ms(1000);
    player.wired.command(Command::Speed, 0);
    player.run_ms(1500);
    EXPECT_EQ(player.wired.command(Command::Hold), Code::Ok);
    player.run_ms(10);
    EXPECT_EQ(player.wired.machine.mode(), Mode::Hold);
    EXPECT_EQ(player.wired.command(Command::Stop), Code::Ok);
    player.wired.run_ms(10);
    EXPECT_EQ(player.wired.machine.mode(), Mode::Idle);
    EXPECT_EQ(player.wired.command(Command::Speed, 1001), Code::BadArgument);
}

TEST(Speed, BoundsTextModeToo) {
    Wired wired(quintic_field(), {0, 0}, true);
    EXPECT_EQ(wired.command(Command::Speed, 250), Code::Ok);
    ASSERT_EQ(wired.follow(5000, 0), Code::Ok);
    wired.run_ms(2000);
    EXPECT_NEAR(wired.fastest(0), 1000, 5);
    EXPECT_EQ(wired.command(Command::Speed, 0), Code::Ok);
    wired.run_ms(1000);
    const int32_t stood = wired.shaft[0];
    wired.run_ms(1000);
    EXPECT_EQ(wired.shaft[0], stood);
    EXPECT_EQ(wired.machine.mode(), Mode::Run);
    EXPECT_EQ(wired.command(Command::Speed, 1000), Code::Ok);
    ASSERT_TRUE(wired.run_until(Mode::Idle));
    EXPECT_EQ(wired.shaft[0], 5000);
    EXPECT_LE(wired.hardest(0), 4000 * 1.1);
}
