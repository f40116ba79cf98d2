// Text mode: `<SEQ,J1,...,Jn>` in, `<ACK,SEQ,TIMESTAMP_US>` out.
#include "text_mode.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "rig.h"

using namespace gemelo;

namespace {

// 10000 steps to the rad: 0.256 of 1/256 step in 1e-7 rad.
constexpr uint64_t kScaleQ32 = 1099511628;

DeviceConfig speaking() {
    DeviceConfig config = rig::two_joints();
    for (JointConfig& joint : config.joint) joint.text_scale_q32 = kScaleQ32;
    return config;
}

TextLine read(const std::string& line, const DeviceConfig& config = speaking()) {
    return read_text_line(line.data(), line.size(), config);
}

// A device that is spoken to in lines.
class Speaker {
  public:
    explicit Speaker(const DeviceConfig& config = speaking()) : rig(config) { text.begin(rig.device.machine()); }
    // The answer without its end of line, or an empty text.
    std::string say(const std::string& line) {
        rig.device.outputs().clear();
        const TextLine read = read_text_line(line.data(), line.size(), rig.device.machine().config());
        if (!read.is_line) return "no line";
        text.receive(read, rig.device.now_us());
        std::string answer;
        for (const OutFrame& frame : rig.device.outputs())
            if (frame.output == Output::Text) answer.assign(frame.payload.begin(), frame.payload.end());
        rig.listen();
        EXPECT_EQ(answer.substr(answer.size() - 2), ">\n");
        return answer.substr(0, answer.size() - 1);
    }
    std::string say(uint32_t seq, const std::string& targets = ",0.01,0.02") {
        return say("<" + std::to_string(seq) + targets + ">");
    }

    rig::Rig rig;
    TextMode text;
};

std::string ack(uint32_t seq, uint64_t t_us) {
    return "<ACK," + std::to_string(seq) + "," + std::to_string(t_us) + ">";
}

}  // namespace

TEST(TextLine, ReadsNumberSeqAndTargets) {
    const TextLine line = read("<4294967295,0.1,-1.234567891>");
    EXPECT_TRUE(line.is_line);
    EXPECT_EQ(line.seq, UINT32_MAX);
    EXPECT_EQ(line.code, Code::Ok);
    EXPECT_EQ(line.target_q8[0], 256000);
    EXPECT_EQ(line.target_q8[1], -3160494);
}

TEST(TextLine, TakesEveryPlainWayToWriteANumber) {
    for (const char* zero : {"0", "-0", "+0.0", ".0", "0.", "000.000000000"})
        EXPECT_EQ(read("<1," + std::string(zero) + ",0.5>").code, Code::Ok) << zero;
    EXPECT_EQ(read("<1,+.5,00.5>").target_q8[0], 1280000);
}

TEST(TextLine, OfNonsenseIsNeverZeros) {
    // The seed read each of these as 0.0 by atof() and drove there, or stored a NaN.
    for (const char* number : {"foo", "", "nan", "NaN", "-nan", "inf", "-Infinity", "1e3", "0x10", "1,", "--1", "+",
                               ".", "1.2.3", " 1", "1 ", "0.1234567890", "1;2"}) {
        const TextLine line = read("<7," + std::string(number) + ",0>");
        EXPECT_TRUE(line.code == Code::BadArgument || line.code == Code::BadCount) << number;
        EXPECT_EQ(line.seq, 7u);
    }
    EXPECT_FALSE(read("<x,foo").is_line);
    const TextLine line = read("<x,foo>");
    EXPECT_EQ(line.code, Code::BadCount);
    EXPECT_EQ(line.seq, 0u);
}

TEST(TextLine, WithAnotherCountOrNoReadableSeqIsRefused) {
    for (const char* bad : {"<1>", "<1,0>", "<1,0,0,0>", "<1,0,0,0,0,0,0,0,0,0,0>", "<4294967296,0,0>",
                            "<99999999999999999999999,0,0>", "<,0,0>", "<>"})
        EXPECT_EQ(read(bad).code, Code::BadCount) << bad;
    EXPECT_EQ(read("<4294967296,0,0>").seq, 0u);
    EXPECT_EQ(read("<1>", DeviceConfig{}).code, Code::NotReady);
}

TEST(TextLine, MergedOrCutOffIsNone) {
    for (const char* bad : {"<1,0,0", "<1,0,0<2,0,0>", "<1,0,0><2,0,0>", "1,0,0>", "", "<", ">", "<1,0>,0>"})
        EXPECT_FALSE(read(bad).is_line) << bad;
}

TEST(TextLine, BeyondAllStepsIsAPositionLimit) {
    for (const char* far :
         {"840", "-840", "99999999", "100000000", "-18446744073709551616", "1000000000000000000000000"})
        EXPECT_EQ(read("<1,0," + std::string(far) + ">").code, Code::PositionLimit) << far;
    EXPECT_EQ(read("<1,0,838>").code, Code::Ok);
    EXPECT_EQ(read("<1,0,0>", rig::two_joints()).code, Code::BadJoints);
}

TEST(TextLine, IsRoundedToTheNearest256thOfAStep) {
    std::mt19937_64 random(3);
    for (int i = 0; i < 20000; ++i) {
        DeviceConfig config = speaking();
        config.joints = 1;
        const double steps_per_unit = std::exp2(static_cast<double>(random() % 2200) / 100.0);
        config.joint[0].text_scale_q32 = static_cast<uint64_t>(std::llround(steps_per_unit * 256e-7 * 4294967296.0));
        const int decimals = static_cast<int>(random() % 10);
        const double farthest = std::min(1e4, 4e6 / steps_per_unit);
        const double value = (static_cast<double>(random() % 2000001) / 1e6 - 1.0) * farthest;
        char text[64];
        std::snprintf(text, sizeof text, "<1,%.*f>", decimals, value);
        const TextLine line = read(text, config);
        ASSERT_EQ(line.code, Code::Ok) << text;
        const double printed = std::strtod(text + 3, nullptr);
        const double exact_q8 = printed * 1e7 * static_cast<double>(config.joint[0].text_scale_q32) / 4294967296.0;
        ASSERT_NEAR(line.target_q8[0], exact_q8, 0.5 + 1e-6) << text;
        // Against the joint as it is: the resolution of the scale comes on top, and of what was written.
        const double scale_error = std::abs(printed) * 1e7 / 4294967296.0 * 0.5;
        const double written = 0.5 * std::pow(10.0, -decimals) * steps_per_unit * 256;
        ASSERT_LE(std::abs(line.target_q8[0] - value * steps_per_unit * 256), 1.0 + scale_error + written) << text;
    }
}

TEST(TextMode, FollowsALineAndAcknowledgesItWithItsTime) {
    Speaker speaker;
    speaker.rig.run_ms(5);
    EXPECT_EQ(speaker.say(1), ack(1, 5000));
    EXPECT_EQ(speaker.rig.mode(), Mode::Run);
    speaker.rig.run_ms(3000);
    EXPECT_EQ(speaker.rig.steps(0), 100);
    EXPECT_EQ(speaker.rig.steps(1), 200);
    EXPECT_EQ(speaker.rig.mode(), Mode::Idle);
}

TEST(TextMode, DoesARepeatedLineOnceAndAnswersItAlike) {
    Speaker speaker;
    EXPECT_EQ(speaker.say(1), ack(1, 0));
    speaker.rig.run_ms(10);
    EXPECT_EQ(speaker.say(1, ",0.05,0.05"), ack(1, 0));
    speaker.rig.run_ms(3000);
    EXPECT_EQ(speaker.rig.steps(0), 100);
    EXPECT_EQ(speaker.text.lost(), 0u);
}

TEST(TextMode, CountsLostLinesOverTheWrapAndNeverUnderZero) {
    Speaker speaker;
    EXPECT_EQ(speaker.say(4294967290), ack(4294967290, 0));
    EXPECT_EQ(speaker.text.lost(), 0u);  // before it there was none: the seed counted 4294967289
    speaker.say(4294967291);
    EXPECT_EQ(speaker.text.lost(), 0u);
    speaker.say(4);  // 92, 93, 94, 95, 0, 1, 2, 3 are missing
    EXPECT_EQ(speaker.text.lost(), 8u);
    EXPECT_NE(speaker.rig.event("text_lost").find("8"), std::string::npos);
    // The seed subtracted these the other way round and lost four thousand million.
    for (const uint32_t old : {3u, 4294967291u}) speaker.say(old);
    EXPECT_EQ(speaker.text.lost(), 8u);
    EXPECT_EQ(speaker.text.late(), 2u);
}

TEST(TextMode, AcknowledgesAnOlderLineAndDoesNotDoIt) {
    Speaker speaker;
    speaker.say(10);
    EXPECT_EQ(speaker.say(9, ",0.05,0.05"), ack(9, 0));
    speaker.rig.run_ms(3000);
    EXPECT_EQ(speaker.rig.steps(0), 100);
}

TEST(TextMode, BelievesASenderThatHasBegunAnew) {
    Speaker speaker;
    speaker.say(5000);
    speaker.rig.run_ms(1000);
    speaker.say(1, ",0.05,0.05");
    speaker.rig.run_ms(3000);
    EXPECT_EQ(speaker.rig.steps(0), 500);
    EXPECT_EQ(speaker.text.lost() + speaker.text.late(), 0u);
}

TEST(TextMode, BelievesASenderThatBeganAnewWithoutAPauseAfterASecond) {
    Speaker speaker;
    speaker.say(5000);
    for (uint32_t seq = 1; seq <= 60; ++seq) {
        speaker.rig.run_ms(20);
        speaker.say(seq, ",0.03,0.03");
    }
    EXPECT_EQ(speaker.text.late(), 49u);
    speaker.rig.run_ms(2000);
    EXPECT_EQ(speaker.rig.steps(0), 300);
}

TEST(TextMode, RefusesWithTheReasonAndMovesNothing) {
    Speaker speaker;
    EXPECT_EQ(speaker.say(1, ",0.1"), "<NAK,1,BAD_COUNT>");
    EXPECT_EQ(speaker.say(2, ",nan,0"), "<NAK,2,BAD_ARGUMENT>");
    EXPECT_EQ(speaker.say(3, ",11,0"), "<NAK,3,POSITION_LIMIT>");
    EXPECT_EQ(speaker.say("<99999999999,0,0>"), "<NAK,0,BAD_COUNT>");
    EXPECT_EQ(speaker.say("<1,0,0"), "no line");
    speaker.rig.run_ms(100);
    EXPECT_EQ(speaker.rig.steps(0), 0);
    EXPECT_EQ(speaker.rig.mode(), Mode::Idle);
    // A line that was refused may be said again, better.
    EXPECT_EQ(speaker.say(3), ack(3, 100000));
    EXPECT_EQ(speaker.text.lost(), 0u);
}

TEST(TextMode, IsNotReadyWhileAStreamIsPlayed) {
    Speaker speaker;
    rig::ChunkSpec chunk;
    chunk.first = true;
    chunk.dt_us = 100000;
    chunk.rows = {{{0, 0}, {0, 0}}, {{256, 0}, {0, 0}}};
    ASSERT_EQ(speaker.rig.send(chunk).code, Code::Ok);
    EXPECT_EQ(speaker.say(1), "<NAK,1,NOT_READY>");
}

TEST(TextMode, DoesNotLetADamagedNumberMakeItDeaf) {
    Speaker speaker;
    speaker.say(1);
    speaker.say("<900000,0.01>");  // a digit too many and a joint too few: not the line that was due
    EXPECT_EQ(speaker.say(2), ack(2, 0));
    EXPECT_EQ(speaker.text.lost() + speaker.text.late(), 0u);
}
