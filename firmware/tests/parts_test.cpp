// The small parts: CRC, cubic, queue, square root, configuration.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "crc32.h"
#include "protocol.h"
#include "rig.h"
#include "segment.h"
#include "time_scale.h"

using namespace gemelo;

TEST(Crc32, IsTheOneOfZlib) {
    const char* check = "123456789";
    EXPECT_EQ(crc32(reinterpret_cast<const uint8_t*>(check), 9), 0xCBF43926u);
    EXPECT_EQ(crc32(nullptr, 0), 0u);
}

TEST(Cubic, BeginsAndEndsExactlyOnItsKnots) {
    std::mt19937 random(1);
    std::uniform_int_distribution<int32_t> position(-20000000, 20000000), velocity(-6000000, 6000000);
    for (int i = 0; i < 10000; ++i) {
        const int32_t p0 = position(random), p1 = p0 + velocity(random) / 50;
        const Cubic cubic = make_cubic(p0, velocity(random), p1, velocity(random), 20000);
        ASSERT_EQ(cubic.at(0), static_cast<int64_t>(p0) * 4096);
        ASSERT_EQ(cubic.at(1u << kUnitBits), static_cast<int64_t>(p1) * 4096);
    }
}

TEST(Cubic, IsAThousandthOfAStepFromTheFormula) {
    const int32_t p0 = 1000, v0 = 1024000, p1 = 21000, v1 = 900000;
    const double dt = 0.020;
    const Cubic cubic = make_cubic(p0, v0, p1, v1, 20000);
    for (int i = 0; i <= 1000; ++i) {
        const double u = i / 1000.0, m0 = v0 * dt, m1 = v1 * dt, d = p1 - p0;
        const double expected = p0 + u * (m0 + u * ((3 * d - 2 * m0 - m1) + u * (m0 + m1 - 2 * d)));
        const uint32_t u_q24 = static_cast<uint32_t>(std::lround(u * (1 << kUnitBits)));
        EXPECT_NEAR(static_cast<double>(cubic.at(u_q24)) / 1048576.0, expected / 256.0, 1e-3);
    }
}

TEST(Cubic, KeepsItsWidthAtTheLongestAndFastestSegment) {
    // 50,000 steps/s for 250 ms: 12,500 steps, the most a tick of 100 kHz can do.
    const int32_t fastest = 50000 * 256;
    const Cubic cubic = make_cubic(0, fastest, 12500 * 256, fastest, kMaxDtUs);
    EXPECT_EQ(cubic.at(1u << 23), 6250ll << kFineBits);
    const Cubic reversal = make_cubic(0, fastest, 0, -fastest, kMaxDtUs);
    EXPECT_EQ(reversal.at(1u << 23), 3125ll << kFineBits);
}

TEST(Cubic, CoversWithAVelocityWhatTheFormulaSays) {
    std::mt19937 random(9);
    std::uniform_int_distribution<int32_t> velocity(-50000 * 256, 50000 * 256);
    std::uniform_int_distribution<uint32_t> dt(kMinDtUs, kMaxDtUs);
    for (int i = 0; i < 100000; ++i) {
        const int32_t v = velocity(random);
        const uint32_t dt_us = dt(random);
        ASSERT_EQ(make_cubic(0, v, 0, 0, dt_us).c1, static_cast<int64_t>(v) * dt_us * 4096 / 1000000);
    }
}

TEST(Segment, SharesTimeAsADivisionWould) {
    std::mt19937_64 random(10);
    for (uint32_t dt_us : {1000u, 1001u, 19999u, 20000u, 99991u, 250000u}) {
        Segment segment;
        Knot from{}, to{};
        to.dt_us = dt_us;
        segment.load(from, to, 1);
        const uint64_t whole = static_cast<uint64_t>(dt_us) << 15;
        for (int i = 0; i < 20000; ++i) {
            const uint64_t time = i == 0 ? whole : random() % (whole + 1);
            ASSERT_EQ(segment.share(time, 24), (time << 9) / dt_us);
            ASSERT_EQ(segment.share(time, 20), (time << 5) / dt_us);
        }
    }
}

TEST(KnotQueue, GivesBackInOrderAcrossItsSeam) {
    KnotQueue queue;
    queue.begin(kMaxKnots);
    Knot knot{};
    uint32_t in = 0, out = 0;
    for (int round = 0; round < 50; ++round) {
        while (queue.space() > 0) {
            knot.dt_us = in++;
            queue.push() = knot;
        }
        for (int i = 0; i < 37; ++i) {
            ASSERT_EQ(queue[0].dt_us, out++);
            queue.pop();
        }
    }
    EXPECT_EQ(queue.newest().dt_us, in - 1);
}

TEST(Root, RoundsDown) {
    std::mt19937_64 random(7);
    std::vector<uint64_t> values = {0, 1, 2, 3, 4, 99, 100, (1ull << 60) - 1, 1ull << 60, (1ull << 62) - 1};
    for (int i = 0; i < 20000; ++i) values.push_back(random() >> (2 + i % 62));
    for (uint64_t i = 1; i < (1ull << 30); i = i * 3 + 1) values.insert(values.end(), {i * i - 1, i * i, i * i + 1});
    for (uint64_t value : values) {
        const uint64_t result = root(value);
        ASSERT_LE(result * result, value);
        ASSERT_GT((result + 1) * (result + 1), value);
    }
}

TEST(Config, NamesTheJointThatIsWrong) {
    DeviceConfig config = rig::two_joints();
    EXPECT_EQ(find_fault(config).sentence, nullptr);
    config.joint[1].max_acceleration_q8 = 0;
    EXPECT_STREQ(find_fault(config).sentence, "its acceleration limit is not positive");
    EXPECT_STREQ(find_fault(config).part, "q2");
    config = rig::two_joints();
    config.tick_hz = 44100;
    EXPECT_NE(find_fault(config).sentence, nullptr);
    std::memset(config.name, 'x', sizeof config.name);
    EXPECT_NE(find_fault(config).sentence, nullptr);
}
