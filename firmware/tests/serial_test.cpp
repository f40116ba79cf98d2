// The serial line: packets out of bytes, and who speaks where.
#include "serial.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "rig.h"

using namespace gemelo;
using rig::Bytes;

namespace {

Bytes packet(const Bytes& frame) {
    Bytes out(cobs_bound(frame.size()));
    CobsWriter writer(out.data());
    writer.put(frame.data(), frame.size());
    out.resize(writer.finish());
    return out;
}

Bytes json_frame(FrameType type, const std::string& text) {
    Bytes bytes(kHeaderSize);
    write_header(bytes.data(), type, 0, 0);
    bytes.insert(bytes.end(), text.begin(), text.end());
    return rig::seal(bytes);
}

Bytes bytes_of(const std::string& text) { return Bytes(text.begin(), text.end()); }

Bytes operator+(Bytes left, const Bytes& right) {
    left.insert(left.end(), right.begin(), right.end());
    return left;
}

struct Piece {
    Packets::Found found;
    Bytes bytes;
};

std::vector<Piece> cut(Packets& packets, const Bytes& bytes) {
    std::vector<Piece> pieces;
    for (const uint8_t byte : bytes) {
        const Packets::Found found = packets.put(byte);
        if (found != Packets::Found::None)
            pieces.push_back({found, Bytes(packets.bytes(), packets.bytes() + packets.size())});
    }
    return pieces;
}

std::vector<Piece> cut(const Bytes& bytes) {
    Packets packets;
    return cut(packets, bytes);
}

// A machine on a serial line and on MQTT.
class Line {
  public:
    explicit Line(const DeviceConfig& wanted = rig::two_joints()) : config(wanted) {
        for (JointConfig& joint : config.joint) joint.text_scale_q32 = 1099511628;
        machine.begin(config, Identity{rig::kBoot, "power_on"}, Sink{this, put, nullptr});
        port.begin(machine, rig::kBoot, other, this);
        const int32_t steps[kMaxJoints] = {};
        machine.start(0, steps, true);
        forget();
    }
    void hear(const Bytes& bytes, uint64_t now_us = 0) {
        forget();
        port.receive(bytes.data(), bytes.size(), now_us, now_us);
    }
    void hear_mqtt(const Bytes& frame) {
        forget();
        const Arrival arrival{frame.data(), frame.size(), false, 0};
        port.yield_to_mqtt(arrival);
        machine.receive(arrival, 0);
    }
    void forget() {
        on_serial.clear();
        on_mqtt.clear();
        others.clear();
        wire.clear();
    }

    DeviceConfig config;
    Machine machine;
    SerialPort port;
    std::vector<Output> on_serial, on_mqtt;
    std::vector<std::pair<FrameType, std::string>> others;
    Bytes wire;

  private:
    static void put(void* self, Output output, const uint8_t* bytes, size_t size) {
        Line& line = *static_cast<Line*>(self);
        if (line.port.carries(output)) {
            uint8_t out[SerialPort::kLargestReport];
            const size_t length = line.port.wrap(output, bytes, size, out, sizeof out);
            EXPECT_GT(length, 0u);
            line.wire.insert(line.wire.end(), out, out + length);
            line.on_serial.push_back(output);
        }
        if (line.port.leaves_to_mqtt(output)) line.on_mqtt.push_back(output);
    }
    static void other(void* self, FrameType type, const uint8_t* text, size_t size) {
        static_cast<Line*>(self)->others.emplace_back(type, std::string(text, text + size));
    }
};

const Bytes kBeat = rig::build_heartbeat(1, 1);
using Outputs = std::vector<Output>;

}  // namespace

TEST(Cobs, IsAsInThePaper) {
    EXPECT_EQ(packet({}), (Bytes{0, 1, 0}));
    EXPECT_EQ(packet({0}), (Bytes{0, 1, 1, 0}));
    EXPECT_EQ(packet({0, 0}), (Bytes{0, 1, 1, 1, 0}));
    EXPECT_EQ(packet({0x11, 0x22, 0, 0x33}), (Bytes{0, 3, 0x11, 0x22, 2, 0x33, 0}));
    EXPECT_EQ(packet({0x11, 0, 0, 0}), (Bytes{0, 2, 0x11, 1, 1, 1, 0}));
    const Bytes full = packet(Bytes(254, 7));
    EXPECT_EQ(full.size(), 257u);
    EXPECT_EQ(full[1], 255);
    const Bytes more = packet(Bytes(255, 7));
    EXPECT_EQ(more.size(), 259u);
    EXPECT_EQ(more[256], 2);
}

TEST(Cobs, BringsEveryFrameBackWithinItsBound) {
    std::mt19937 random(5);
    for (int i = 0; i < 3000; ++i) {
        Bytes frame(1 + random() % 1200);
        const uint32_t zeros = random() % 3;
        for (uint8_t& byte : frame)
            byte = static_cast<uint8_t>(zeros == 0 ? 1 + random() % 255 : random() % (zeros == 1 ? 2 : 256));
        frame[0] = kMagic;
        const Bytes sent = packet(frame);
        ASSERT_LE(sent.size(), cobs_bound(frame.size()));
        for (size_t at = 1; at + 1 < sent.size(); ++at) ASSERT_NE(sent[at], 0);
        const std::vector<Piece> pieces = cut(sent);
        ASSERT_EQ(pieces.size(), 1u);
        ASSERT_EQ(pieces[0].found, Packets::Found::Frame);
        ASSERT_EQ(pieces[0].bytes, frame);
    }
}

TEST(Packets, GarbageBeforeAFrameCostsThatGarbageOnly) {
    std::mt19937 random(6);
    for (int i = 0; i < 2000; ++i) {
        Bytes garbage(random() % 300);
        for (uint8_t& byte : garbage) byte = static_cast<uint8_t>(random());
        const std::vector<Piece> pieces = cut(garbage + packet(kBeat));
        ASSERT_FALSE(pieces.empty());
        ASSERT_EQ(pieces.back().bytes, kBeat);
    }
}

TEST(Packets, LinesOfTextStandBetweenFrames) {
    const Bytes sent = bytes_of("<1,0.5>\n") + packet(kBeat) + bytes_of("<2,1>\r\n<3,1>\n") + packet(kBeat);
    const std::vector<Piece> pieces = cut(sent);
    ASSERT_EQ(pieces.size(), 5u);
    EXPECT_EQ(pieces[0].bytes, bytes_of("<1,0.5>"));
    EXPECT_EQ(pieces[1].bytes, kBeat);
    EXPECT_EQ(pieces[2].bytes, bytes_of("<2,1>"));
    EXPECT_EQ(pieces[3].bytes, bytes_of("<3,1>"));
    EXPECT_EQ(pieces[4].bytes, kBeat);
}

TEST(Packets, TextAfterGarbageIsHeardFromTheNextLineOn) {
    for (const char* garbage :
         {"\n", "\r\n\r\n", "hello\n", "\xff\xfe\x80\n", "<\n", "<x,foo>\n", "<1,0.5\xff\n", "rst:0x1 (POWERON)\r\n"}) {
        const std::vector<Piece> pieces = cut(bytes_of(garbage) + bytes_of("<7,1>\n"));
        ASSERT_FALSE(pieces.empty()) << garbage;
        EXPECT_EQ(pieces.back().found, Packets::Found::Line);
        EXPECT_EQ(pieces.back().bytes, bytes_of("<7,1>")) << garbage;
    }
}

TEST(Packets, TooLongAFrameOrLineIsDroppedAndTheNextOneHeard) {
    Bytes frame(kMaxFrame, 1);
    frame[0] = kMagic;
    std::vector<Piece> pieces = cut(packet(frame));
    ASSERT_EQ(pieces.size(), 1u);
    EXPECT_EQ(pieces[0].bytes.size(), kMaxFrame);
    frame.push_back(1);
    pieces = cut(packet(frame) + packet(kBeat));
    ASSERT_EQ(pieces.size(), 2u);
    EXPECT_EQ(pieces[0].found, Packets::Found::Bad);
    EXPECT_EQ(pieces[1].bytes, kBeat);
    const std::string longest = "<1," + std::string(kMaxTextLine - 4, '0') + ">";
    EXPECT_EQ(cut(bytes_of(longest + "\r\n"))[0].found, Packets::Found::Line);
    pieces = cut(bytes_of(longest + "0\n<2,1>\n"));
    ASSERT_EQ(pieces.size(), 2u);
    EXPECT_EQ(pieces[0].found, Packets::Found::Bad);
    EXPECT_EQ(pieces[1].bytes, bytes_of("<2,1>"));
    pieces = cut(bytes_of(longest + longest + "\n<3,1>\n"));
    ASSERT_EQ(pieces.size(), 2u);
    EXPECT_EQ(pieces[0].found, Packets::Found::Bad);
    EXPECT_EQ(pieces[1].bytes, bytes_of("<3,1>"));
}

TEST(Packets, AFrameThatIsCutOffIsBad) {
    const Bytes whole = packet(kBeat);
    for (size_t size = 2; size + 1 < whole.size(); ++size) {
        const std::vector<Piece> pieces =
            cut(Bytes(whole.begin(), whole.begin() + static_cast<long>(size)) + packet(kBeat));
        ASSERT_EQ(pieces.size(), 2u);
        EXPECT_NE(pieces[0].bytes, kBeat);
        EXPECT_EQ(pieces[1].bytes, kBeat);
    }
}

TEST(SerialPort, GreetsAStrangerThereOnlyAndAnswersWhereItWasAsked) {
    Line line;
    line.hear(packet(rig::build_sync(7)));
    EXPECT_EQ(line.on_serial, (Outputs{Output::Status, Output::SyncReply}));
    EXPECT_TRUE(line.on_mqtt.empty());
    line.hear(packet(rig::build_sync(8)), 2000000);
    EXPECT_EQ(line.on_serial, Outputs{Output::SyncReply});
    line.hear(packet(rig::build_sync(9)), 4000001);
    EXPECT_EQ(line.on_serial, (Outputs{Output::Status, Output::SyncReply}));
    line.hear_mqtt(rig::build_sync(7));
    EXPECT_EQ(line.on_mqtt, Outputs{Output::SyncReply});
    EXPECT_TRUE(line.on_serial.empty());
}

TEST(SerialPort, SaysItsStateWhereTheLastSignOfLifeCameFromAndEventsOnBoth) {
    Line line;
    EXPECT_TRUE(line.port.carries(Output::State) && line.port.leaves_to_mqtt(Output::State));
    line.hear(packet(kBeat));
    EXPECT_TRUE(line.port.carries(Output::State) && !line.port.leaves_to_mqtt(Output::State));
    line.hear_mqtt(rig::build_sync(1));
    EXPECT_TRUE(line.port.carries(Output::State));
    line.hear_mqtt(rig::build_heartbeat(1, 2));
    EXPECT_TRUE(!line.port.carries(Output::State) && line.port.leaves_to_mqtt(Output::State));
    line.hear(bytes_of("<1,0,0>\n"));
    EXPECT_TRUE(line.port.carries(Output::Sensors) && !line.port.leaves_to_mqtt(Output::Sensors));
    for (const Output both : {Output::Status, Output::Event})
        EXPECT_TRUE(line.port.carries(both) && line.port.leaves_to_mqtt(both));
}

TEST(SerialPort, AnswersAPieceOfAnUpdateInAFrame) {
    Line line;
    EXPECT_EQ(line.port.understood(), 0u);
    line.hear(packet(rig::build_update(UpdateStep::Begin, 5, 0, rig::build_update_begin(10000, 1))));
    EXPECT_EQ(line.on_serial.back(), Output::UpdateAck);
    EXPECT_EQ(line.port.understood(), 1u);
    const std::vector<Piece> said = cut(line.wire);
    ASSERT_FALSE(said.empty());
    EXPECT_EQ(said.back().bytes[2], static_cast<uint8_t>(FrameType::UpdateAck));
    EXPECT_TRUE(line.on_mqtt.empty());
}

TEST(SerialPort, AnswersALineOfTextAsItIs) {
    Line line;
    line.hear(packet(rig::build_sync(1)));
    line.hear(bytes_of("<5,0.01,0.02>\n"), 1234);
    EXPECT_EQ(line.wire, bytes_of("<ACK,5,1234>\n"));
    line.hear(bytes_of("<6,0.01>\n"), 1300);
    EXPECT_EQ(line.wire, bytes_of("<NAK,6,BAD_COUNT>\n"));
    line.hear(bytes_of("<7,0.01,0.0<8,0.01,0.02>\n"), 1400);
    EXPECT_TRUE(line.wire.empty());
}

TEST(SerialPort, TakesAConfigurationInAFrameAndAnswersInOne) {
    DeviceConfig none{};
    Line line(none);
    const std::string text =
        R"({"name":"x","joints":[{"name":"q1","lower_q8":0,"upper_q8":9,"max_velocity_q8":9,"max_acceleration_q8":9}]})";
    line.hear(packet(json_frame(FrameType::Config, text)));
    EXPECT_EQ(line.config.joints, 1);
    EXPECT_EQ(line.on_serial, (Outputs{Output::Status, Output::ConfigAck, Output::Event, Output::Status}));
    EXPECT_EQ(line.on_mqtt, (Outputs{Output::Event, Output::Status}));
    const std::vector<Piece> pieces = cut(line.wire);
    ASSERT_EQ(pieces.size(), 4u);
    const Frame frame = open_frame(pieces[1].bytes.data(), pieces[1].bytes.size());
    ASSERT_TRUE(frame.is_valid());
    EXPECT_EQ(frame.type(), FrameType::ConfigAck);
    EXPECT_EQ(frame.boot_id(), rig::kBoot);
    const std::string answer(frame.bytes + kHeaderSize, frame.bytes + frame.size);
    EXPECT_NE(answer.find("\"accepted\": true"), std::string::npos);
}

TEST(SerialPort, HandsOnWhatIsThePlatforms) {
    Line line;
    line.hear(packet(json_frame(FrameType::Provision, "{}")) + packet(json_frame(FrameType::Inject, "{\"a\":1}")));
    ASSERT_EQ(line.others.size(), 2u);
    EXPECT_EQ(line.others[0], std::make_pair(FrameType::Provision, std::string("{}")));
    EXPECT_EQ(line.others[1].second, "{\"a\":1}");
}

TEST(SerialPort, APauseEndsWhatHasBegun) {
    Line line;
    Bytes half = packet(kBeat);
    half.resize(10);
    line.hear(half, 1000000);
    line.hear(bytes_of("<5,0,0>\n"), 2000001);
    EXPECT_EQ(line.on_serial.back(), Output::Text);
}

TEST(SerialPort, HasRoomForTheLargestReports) {
    Line line;
    uint8_t out[SerialPort::kLargestReport];
    const Bytes text(JsonWriter::kSize, 'a'), state(60 + 8 * kMaxJoints + 4, 0);
    EXPECT_GT(line.port.wrap(Output::Event, text.data(), text.size(), out, sizeof out), 0u);
    EXPECT_GT(line.port.wrap(Output::State, state.data(), state.size(), out, sizeof out), 0u);
    EXPECT_EQ(line.port.wrap(Output::Event, text.data(), text.size(), out, sizeof out - 1), 0u);
}

TEST(SerialPort, FramesWhatIsJsonByItsType) {
    Line line;
    uint8_t out[SerialPort::kLargestReport];
    const Bytes text = bytes_of("{}");
    const std::pair<Output, FrameType> kinds[] = {{Output::ConfigAck, FrameType::ConfigAck},
                                                  {Output::Sensors, FrameType::Sensors},
                                                  {Output::Status, FrameType::Status},
                                                  {Output::Event, FrameType::Event}};
    for (const auto& [output, type] : kinds) {
        const size_t size = line.port.wrap(output, text.data(), text.size(), out, sizeof out);
        const std::vector<Piece> pieces = cut(Bytes(out, out + size));
        ASSERT_EQ(pieces.size(), 1u);
        EXPECT_EQ(pieces[0].bytes[2], static_cast<uint8_t>(type));
    }
}
