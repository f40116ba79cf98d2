// The vectors that the Python side is tested with too.
#include <gtest/gtest.h>

#include <cstring>

#include "bytes.h"
#include "config_text.h"
#include "vectors.h"
#include "virtual_device.h"

using namespace gemelo;

namespace {

const char* topic(Output output) {
    constexpr const char* kTopics[] = {"traj/ack", "cmd/ack", "sync/r", "state", "event", "status"};
    return kTopics[static_cast<int>(output)];
}

// The first answer that is neither an event nor a status.
const OutFrame* answer_in(const std::deque<OutFrame>& outputs) {
    for (const OutFrame& frame : outputs)
        if (frame.output != Output::Event && frame.output != Output::Status) return &frame;
    return nullptr;
}

void expect_answer(const Vector& vector, const OutFrame& answer) {
    const uint8_t* at = answer.payload.data();
    ASSERT_STREQ(topic(answer.output), vector.answer);
    if (answer.output == Output::CmdAck) {
        EXPECT_EQ(at[13], vector.code);
    }
    if (answer.output != Output::TrajAck) return;
    EXPECT_EQ(at[20], vector.code);
    EXPECT_EQ(at[21], vector.joint);
    EXPECT_EQ(load_u16(at + 22), vector.knot);
    EXPECT_EQ(load_i32(at + 24), vector.value);
    EXPECT_EQ(load_i32(at + 28), vector.limit);
}

DeviceConfig vector_device() {
    DeviceConfig config;
    Refusal refusal;
    EXPECT_TRUE(parse_config(kVectorConfig.data(), kVectorConfig.size(), &config, &refusal)) << refusal.reason;
    return config;
}

}  // namespace

TEST(Vectors, AFreshDeviceAnswersEachAsExpected) {
    ASSERT_GT(kVectors.size(), 30u);
    for (const Vector& vector : kVectors) {
        SCOPED_TRACE(vector.name);
        VirtualDevice device(vector_device(), kVectorBoot, "power_on", 0);
        const int32_t steps[kMaxJoints] = {};
        device.start(steps, true);
        device.outputs().clear();
        device.receive(vector.frame.data(), vector.frame.size(), vector.retained, 0);
        const OutFrame* answer = answer_in(device.outputs());
        if (vector.answer == nullptr) {
            EXPECT_EQ(answer, nullptr);
        } else {
            ASSERT_NE(answer, nullptr);
            expect_answer(vector, *answer);
        }
    }
}
