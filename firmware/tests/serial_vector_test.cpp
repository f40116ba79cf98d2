// The vectors of the serial line that the Python side is tested with too.
#include <gtest/gtest.h>

#include "config_text.h"
#include "rig.h"
#include "serial.h"
#include "serial_vectors.h"

using namespace gemelo;

namespace {

std::string hex(const uint8_t* bytes, size_t size) {
    std::string text;
    for (size_t i = 0; i < size; ++i) {
        text += "0123456789abcdef"[bytes[i] >> 4];
        text += "0123456789abcdef"[bytes[i] & 15];
    }
    return text;
}

rig::Bytes bytes_of(const std::string& text) {
    rig::Bytes bytes;
    for (size_t at = 0; at < text.size(); at += 2)
        bytes.push_back(static_cast<uint8_t>(std::stoi(text.substr(at, 2), nullptr, 16)));
    return bytes;
}

}  // namespace

TEST(SerialVectors, PacketsAreCutAlike) {
    ASSERT_GT(kPackets.size(), 10u);
    for (const PacketVector& vector : kPackets) {
        SCOPED_TRACE(vector.name);
        Packets packets;
        std::vector<std::string> frames;
        int bad = 0;
        for (const uint8_t byte : bytes_of(vector.sent)) {
            const Packets::Found found = packets.put(byte);
            if (found == Packets::Found::Frame) frames.push_back(hex(packets.bytes(), packets.size()));
            bad += found == Packets::Found::Bad;
        }
        EXPECT_EQ(frames, vector.frames);
        EXPECT_EQ(bad, vector.bad);
    }
}

TEST(SerialVectors, LinesAreAnsweredAlike) {
    ASSERT_GT(kLines.size(), 6u);
    for (const LineVector& vector : kLines) {
        SCOPED_TRACE(vector.name);
        DeviceConfig config;
        Refusal refusal;
        ASSERT_TRUE(parse_config(kTextConfig.data(), kTextConfig.size(), &config, &refusal)) << refusal.reason;
        rig::Rig rig(config);
        SerialPort port;
        port.begin(rig.device.machine(), rig::kBoot, nullptr, nullptr);
        rig.device.outputs().clear();
        for (const std::string& line : vector.lines)
            port.receive(reinterpret_cast<const uint8_t*>((line + "\n").data()), line.size() + 1, 0, 0);
        std::vector<std::string> answers;
        for (const OutFrame& frame : rig.device.outputs())
            if (frame.output == Output::Text) answers.emplace_back(frame.payload.begin(), frame.payload.end() - 1);
        EXPECT_EQ(answers, vector.answers);
        EXPECT_EQ(port.text_mode().lost(), vector.lost);
        EXPECT_EQ(port.text_mode().late(), vector.late);
    }
}

TEST(SerialVectors, ConfigurationsAreJudgedAlike) {
    ASSERT_GT(kConfigs.size(), 10u);
    for (const ConfigVector& vector : kConfigs) {
        SCOPED_TRACE(vector.name);
        DeviceConfig config;
        Refusal refusal;
        EXPECT_EQ(parse_config(vector.text.data(), vector.text.size(), &config, &refusal), vector.reason.empty());
        EXPECT_EQ(refusal.part, vector.part);
        EXPECT_EQ(refusal.reason, vector.reason);
    }
}
