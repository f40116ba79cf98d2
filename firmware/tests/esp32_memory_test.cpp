// The board's memory over a warm reset, the times of its attempts, its button and its topics.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "back_off.h"
#include "factory_button.h"
#include "feeding.h"
#include "pose_memory.h"
#include "topics.h"

using namespace gemelo;

namespace {

constexpr uint32_t kConfig = 0xC0FFEE;

Pose standing() {
    Pose pose{};
    for (uint8_t j = 0; j < kMaxJoints; ++j) pose.steps[j] = 1000 * j - 3000;
    pose.config_crc32 = kConfig;
    pose.is_referenced = true;
    return pose;
}

PoseMemory kept(const Pose& pose) {
    PoseMemory memory;
    std::memset(static_cast<void*>(&memory), 0xA5, sizeof memory);  // as RTC memory is after power-on
    memory.keep(pose);
    return memory;
}

}  // namespace

TEST(PoseMemory, KnowsWhereTheJointsStandAfterAWarmReset) {
    const Awakening awakening = wake(kept(standing()), true, kConfig);
    EXPECT_TRUE(awakening.is_referenced);
    EXPECT_FALSE(awakening.was_moving);
    EXPECT_EQ(std::memcmp(awakening.steps, standing().steps, sizeof awakening.steps), 0);
}

TEST(PoseMemory, IsNotBelievedAfterPowerOnOrABrownOut) {
    const Awakening awakening = wake(kept(standing()), false, kConfig);
    EXPECT_FALSE(awakening.is_referenced);
    EXPECT_EQ(awakening.steps[0], 0);
}

TEST(PoseMemory, SaysThatAMotionWasCutOff) {
    Pose pose = standing();
    pose.is_moving = true;
    const Awakening awakening = wake(kept(pose), true, kConfig);
    EXPECT_FALSE(awakening.is_referenced);
    EXPECT_TRUE(awakening.was_moving);
}

TEST(PoseMemory, MeansNothingUnderAnotherConfiguration) {
    EXPECT_FALSE(wake(kept(standing()), true, kConfig + 1).is_referenced);
}

TEST(PoseMemory, SeesEveryBitThatFlips) {
    const PoseMemory memory = kept(standing());
    const size_t fields = sizeof(Pose::steps) + sizeof(uint32_t);
    for (size_t bit = 0; bit < 8 * fields; ++bit) {
        PoseMemory flipped = memory;
        reinterpret_cast<uint8_t*>(&flipped)[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
        ASSERT_FALSE(flipped.is_valid()) << bit;
        ASSERT_FALSE(wake(flipped, true, kConfig).is_referenced);
    }
}

TEST(PoseMemory, IsInvalidWhileItsContentIsAnything) {
    PoseMemory memory;
    for (const int fill : {0x00, 0xFF, 0x5A}) {
        std::memset(static_cast<void*>(&memory), fill, sizeof memory);
        EXPECT_FALSE(wake(memory, true, 0).is_referenced) << fill;
    }
}

TEST(BackOff, TriesEverMoreSeldomAndSoonAfterASuccess) {
    BackOff back_off;
    uint64_t now_us = 0;
    std::string pauses;
    for (int i = 0; i < 8; ++i) {
        back_off.fail(now_us);
        const uint64_t failed_us = now_us;
        while (!back_off.is_due(now_us)) now_us += 100000;
        EXPECT_FALSE(back_off.is_due(now_us));
        pauses += std::to_string((now_us - failed_us) / 100000) + " ";
    }
    EXPECT_EQ(pauses, "5 10 20 40 80 160 160 160 ");
    back_off.succeed();
    back_off.fail(now_us);
    EXPECT_TRUE(back_off.is_due(now_us + 500000));
}

TEST(BackOff, DoesNothingUntilSomethingFails) {
    BackOff back_off;
    EXPECT_FALSE(back_off.is_due(UINT64_MAX));
}

TEST(FactoryButton, WantsFiveSecondsWithoutAPause) {
    FactoryButton button;
    for (uint64_t ms = 0; ms < 4900; ms += 10) ASSERT_FALSE(button.is_held(true, ms * 1000));
    EXPECT_FALSE(button.is_held(false, 4900000));
    for (uint64_t ms = 4910; ms < 9900; ms += 10) ASSERT_FALSE(button.is_held(true, ms * 1000));
    EXPECT_TRUE(button.is_held(true, 9910000));
    EXPECT_FALSE(button.is_held(true, 9920000));  // once
}

TEST(FactoryButton, IsDeafLaterThanTenSecondsAfterTheStart) {
    FactoryButton button;
    button.is_held(false, 0);
    for (uint64_t s = 10; s < 60; ++s) ASSERT_FALSE(button.is_held(true, s * 1000000));
}

TEST(Topics, AreThoseOfTheDevice) {
    Topics topics;
    topics.begin("rm1");
    EXPECT_STREQ(topics.full("traj/ack"), "gemelo/v1/rm1/traj/ack");
    const std::string topic = "gemelo/v1/rm1/hb";
    const Heard* heard = topics.find(topic.data(), topic.size());
    ASSERT_NE(heard, nullptr);
    EXPECT_EQ(heard->type, FrameType::Heartbeat);
    EXPECT_EQ(heard->qos, 0);
}

TEST(Topics, OfOthersAreNotHeard) {
    Topics topics;
    topics.begin("rm1");
    for (const std::string topic :
         {"gemelo/v1/rm2/hb", "gemelo/v1/rm1/", "gemelo/v1/rm1/hbx", "gemelo/v1/rm1/traj/ack", ""})
        EXPECT_EQ(topics.find(topic.data(), topic.size()), nullptr) << topic;
}

TEST(Topics, HoldTheLongestName) {
    Topics topics;
    topics.begin("a123456789b123456789c123456789d");
    EXPECT_STREQ(topics.full("config/ack"), "gemelo/v1/a123456789b123456789c123456789d/config/ack");
}

TEST(Topics, OnlyTheStatusIsRetained) {
    for (uint8_t output = 0; output <= static_cast<uint8_t>(Output::Sensors); ++output) {
        const Said topic = said(static_cast<Output>(output));
        ASSERT_NE(topic.name, nullptr);
        EXPECT_EQ(topic.is_retained, std::string(topic.name) == "status");
    }
    EXPECT_EQ(said(Output::Text).name, nullptr);
}

TEST(Feeding, GoesByTheTimeAndNotByTheTurns) {
    // Turns of 60 ms, as where each writes a sector of a slow flash: by a count of 100 turns it came after 6 s.
    Feeding feeding;
    uint64_t fed_us = 0;
    ASSERT_TRUE(feeding.is_due(0));
    for (uint64_t now_us = 60000; now_us < 20000000; now_us += 60000) {
        if (feeding.is_due(now_us)) fed_us = now_us;
        EXPECT_LT(now_us - fed_us, 200000u);
    }
    // And of a millisecond: not with each.
    uint32_t fed = 0;
    for (uint64_t now_us = 20000000; now_us < 21000000; now_us += 1000) fed += feeding.is_due(now_us) ? 1 : 0;
    EXPECT_LE(fed, 11u);
    EXPECT_GE(fed, 9u);
}
