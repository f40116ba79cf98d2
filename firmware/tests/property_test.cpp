// Random streams over a bad link: whatever is lost, repeated, late, held or starved, no step is.
#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <random>

#include "motion.h"

using namespace gemelo;
using namespace rig;

namespace {

class BadLink {
  public:
    BadLink(uint32_t seed) : random_(seed) {}
    bool chance(double probability) { return std::uniform_real_distribution<>(0, 1)(random_) < probability; }
    int between(int low, int high) { return std::uniform_int_distribution<>(low, high)(random_); }
    // 10 % of the chunks are lost, 20 % arrive twice; returns the last answer, if there is one.
    std::optional<Ack> send(Rig& rig, const ChunkSpec& chunk) {
        if (chance(0.1)) return std::nullopt;
        Ack ack = rig.send(chunk);
        if (chance(0.2)) {
            const Ack again = rig.send(chunk);
            if (ack.code == Code::Ok) {
                EXPECT_EQ(again.code, Code::Duplicate);
            }
        }
        return ack;
    }

  private:
    std::mt19937 random_;
};

// A gateway with a simple idea of repair: it sends from next_seq on.
class Gateway {
  public:
    Gateway(const Motion& motion, uint32_t stream, size_t chunk_knots)
        : motion_(motion), stream_(stream), size_(chunk_knots) {}

    void work(Rig& rig, BadLink& link) {
        for (int pipelined = 0; pipelined < 3; ++pipelined) {
            const size_t begin = seq_ * size_;
            if (begin >= motion_.knots()) {
                seq_ = wanted_;
                return;
            }
            const size_t end = std::min(begin + size_, motion_.knots());
            const std::optional<Ack> ack =
                link.send(rig, motion_.chunk(begin, end, static_cast<uint32_t>(seq_), stream_));
            ++seq_;
            if (!ack) continue;
            wanted_ = ack->next_seq;
            ASSERT_TRUE(ack->code == Code::Ok || ack->code == Code::Duplicate || ack->code == Code::Gap ||
                        ack->code == Code::NoSpace || ack->code == Code::WrongStream)
                << static_cast<int>(ack->code);
            if (ack->code != Code::Ok) seq_ = wanted_;
            if (ack->code == Code::NoSpace) return;
        }
    }

  private:
    Motion motion_;
    uint32_t stream_;
    size_t size_;
    size_t seq_ = 0, wanted_ = 0;
};

// A slot at a time, with everything that must hold at its end.
struct Inspector {
    std::vector<double> before;

    void step(Rig& rig) {
        rig.run_ms(1);
        const Machine& machine = rig.device.machine();
        for (uint8_t j = 0; j < 2; ++j) {
            const int64_t path = machine.present().position_q20[j];
            ASSERT_EQ(machine.stepper().latched(j), (path + (1 << 19)) >> kFineBits) << "steps = floor(p + 0.5)";
            const double position = rig.path(j);
            // 4000 steps/s is 4 steps a slot; where a stream starts, the path may be one step off the pose.
            ASSERT_LE(std::fabs(position - before[j]), 5.05) << "a jump";
            before[j] = position;
        }
    }
};

}  // namespace

class RandomStreams : public testing::TestWithParam<uint32_t> {};

TEST_P(RandomStreams, LoseNoStepWhateverTheLinkDoes) {
    BadLink link(GetParam());
    Rig rig;
    Inspector inspector{{0, 0}};
    for (uint32_t stream = 1; stream <= 6; ++stream) {
        const double from0 = rig.steps(0), from1 = rig.steps(1);
        const std::vector<double> target = {from0 + link.between(-6000, 6000), from1 + link.between(-2000, 2000)};
        const double dt = link.between(0, 1) ? 0.020 : 0.010;
        const Motion motion = quintic({from0, from1}, target, dt);
        Gateway gateway(motion, stream, static_cast<size_t>(link.between(5, 30)));
        int silence = 0;
        for (int ms = 0; ms < 60000; ++ms) {
            if (rig.count_events("finished") == static_cast<int>(stream)) break;
            if (silence > 0) {
                --silence;
            } else if (link.chance(0.002)) {
                silence = link.between(50, 1500);
            } else if (ms % 20 == 0) {
                gateway.work(rig, link);
            }
            if (link.chance(0.001)) rig.command(Command::Hold);
            if (rig.mode() == Mode::Hold && link.chance(0.01)) rig.command(Command::Resume);
            ASSERT_NO_FATAL_FAILURE(inspector.step(rig));
        }
        ASSERT_EQ(rig.mode(), Mode::Idle);
        ASSERT_EQ(rig.steps(0), static_cast<int32_t>(target[0]));
        ASSERT_EQ(rig.steps(1), static_cast<int32_t>(target[1]));
    }
    EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomStreams, testing::Range(1u, 13u));

TEST(Reboot, InTheMiddleOfAStreamMakesEveryOldFrameVoid) {
    const Motion motion = quintic({0, 0}, {3000, 0});
    Rig before;
    before.send(motion.chunk(0, 50, 0));
    before.run_ms(600);
    ASSERT_NE(before.steps(0), 0);

    Rig after(two_joints(), false, 0, kBoot + 1);
    EXPECT_EQ(after.send(motion.chunk(50, 60, 1)).code, Code::WrongBoot);
    EXPECT_EQ(after.send_command(build_command(Command::Resume, 1)), Code::WrongBoot);
    ChunkSpec fresh = motion.chunk(0, 50, 0, 8);
    fresh.boot_id = kBoot + 1;
    EXPECT_EQ(after.send(fresh).code, Code::NotReady);
    after.run_ms(500);
    EXPECT_EQ(after.steps(0), 0);
    EXPECT_EQ(after.mode(), Mode::Unreferenced);
}
