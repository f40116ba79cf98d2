// MQTT: what the broker is asked for and told, and how messages become records.
#include "mqtt.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "board.h"
#include "fake_idf.h"
#include "frames.h"
#include "transport.h"

using namespace gemelo;
using fake::chip;

namespace {

class Connected {
  public:
    Connected() {
        fake::reset();
        board = Board{};
        std::strcpy(credentials_.device, "rm1");
        std::strcpy(credentials_.mqtt_uri, "mqtt://host");
        mqtt_.begin(credentials_, rig::kBoot);
        send(MQTT_EVENT_CONNECTED, nullptr);
        Record record;
        EXPECT_TRUE(board.from_mqtt.front(&record));
        EXPECT_EQ(record.kind, static_cast<uint8_t>(Inbound::Connected));
        board.from_mqtt.pop();
    }
    Mqtt& mqtt() { return mqtt_; }
    void send(esp_mqtt_event_id_t id, esp_mqtt_event_t* event) { chip.mqtt_handler(chip.mqtt_context, "", id, event); }
    // In pieces of `piece` bytes; as with esp-mqtt, only the first tells the topic.
    void deliver(std::string topic, rig::Bytes bytes, size_t piece, bool is_retained = false) {
        for (size_t at = 0; at == 0 || at < bytes.size(); at += piece) {
            esp_mqtt_event_t event{};
            event.topic = at == 0 ? topic.data() : nullptr;
            event.topic_len = at == 0 ? static_cast<int>(topic.size()) : 0;
            event.data = reinterpret_cast<char*>(bytes.data()) + at;
            event.data_len = static_cast<int>(std::min(piece, bytes.size() - at));
            event.total_data_len = static_cast<int>(bytes.size());
            event.current_data_offset = static_cast<int>(at);
            event.retain = at == 0 && is_retained;
            send(MQTT_EVENT_DATA, &event);
        }
    }

  private:
    Credentials credentials_;
    Mqtt mqtt_;
};

}  // namespace

TEST(Esp32Mqtt, ItsClientIdHasTheDevicesNameAndARandomPart) {
    Connected connected;
    EXPECT_STREQ(chip.mqtt.credentials.client_id, "gemelo-device-rm1-400000004000");  // the random number here is 4
}

TEST(Esp32Mqtt, TheBrokerKeepsALastWillThatSaysWhoIsGone) {
    Connected connected;
    EXPECT_EQ(chip.will, R"(gemelo/v1/rm1/status {"online": false, "device": "rm1", "boot_id": 305419896})");
    EXPECT_EQ(chip.mqtt.session.last_will.qos, 1);
    EXPECT_EQ(chip.mqtt.session.last_will.retain, 1);
    EXPECT_FALSE(chip.mqtt.session.disable_clean_session);
}

TEST(Esp32Mqtt, ADeviceShowsItsOwnCertificateOverTlsOnlyAndOnlyIfItHasOne) {
    Credentials credentials;
    std::strcpy(credentials.mqtt_ca, "the authority");
    std::strcpy(credentials.mqtt_certificate, "who I am");
    std::strcpy(credentials.mqtt_key, "its key");
    fake::reset();
    std::strcpy(credentials.mqtt_uri, "mqtt://host");
    make_transport(credentials);
    EXPECT_EQ(chip.tls_authority + chip.tls_certificate + chip.tls_key, "");
    std::strcpy(credentials.mqtt_uri, "mqtts://host");
    make_transport(credentials);
    EXPECT_EQ(chip.tls_authority, "the authority");
    EXPECT_EQ(chip.tls_certificate, "who I am");
    EXPECT_EQ(chip.tls_key, "its key");
    fake::reset();
    credentials.mqtt_ca[0] = credentials.mqtt_certificate[0] = credentials.mqtt_key[0] = 0;
    make_transport(credentials);
    EXPECT_EQ(chip.tls_authority, "public authorities");
    EXPECT_EQ(chip.tls_certificate + chip.tls_key, "");
}

TEST(Esp32Mqtt, SubscribesToWhatADeviceHears) {
    Connected connected;
    const std::vector<std::string> expected = {"gemelo/v1/rm1/traj 1",   "gemelo/v1/rm1/cmd 1",
                                               "gemelo/v1/rm1/hb 0",     "gemelo/v1/rm1/sync 0",
                                               "gemelo/v1/rm1/config 1", "gemelo/v1/rm1/update 1"};
    EXPECT_EQ(chip.subscriptions, expected);
}

TEST(Esp32Mqtt, SubscribesToAllOfItAnewWhileItIsConnected) {
    Connected connected;
    const std::vector<std::string> once = chip.subscriptions;
    connected.mqtt().subscribe();
    ASSERT_EQ(chip.subscriptions.size(), 2 * once.size());
    EXPECT_TRUE(std::equal(once.begin(), once.end(), chip.subscriptions.begin() + static_cast<long>(once.size())));
    connected.send(MQTT_EVENT_DISCONNECTED, nullptr);
    connected.mqtt().subscribe();
    EXPECT_EQ(chip.subscriptions.size(), 2 * once.size());
}

TEST(Esp32Mqtt, PublishesEachOutputOnItsTopicAndOnlyTheStatusRetained) {
    Connected connected;
    const uint8_t byte = 1;
    connected.mqtt().publish(Output::TrajAck, &byte, 1);
    connected.mqtt().publish(Output::Status, &byte, 1);
    connected.mqtt().publish(Output::Text, &byte, 1);
    connected.send(MQTT_EVENT_DISCONNECTED, nullptr);
    connected.mqtt().publish(Output::State, &byte, 1);
    const std::vector<std::string> expected = {"gemelo/v1/rm1/traj/ack 0", "gemelo/v1/rm1/status 1 retained"};
    EXPECT_EQ(chip.published, expected);
}

TEST(Esp32Mqtt, AMessageInPiecesBecomesOneRecord) {
    Connected connected;
    const rig::Bytes frame = rig::build_command(Command::Hold, 5);
    for (const size_t piece : {size_t{1}, size_t{7}, frame.size()}) {
        connected.deliver("gemelo/v1/rm1/cmd", frame, piece, true);
        Record record;
        ASSERT_TRUE(board.from_mqtt.front(&record)) << piece;
        EXPECT_EQ(record.kind, static_cast<uint8_t>(Inbound::Frame));
        EXPECT_EQ(record.flags, kRetained);
        EXPECT_EQ(rig::Bytes(record.bytes, record.bytes + record.size), frame);
        board.from_mqtt.pop();
        EXPECT_FALSE(board.from_mqtt.front(&record));
    }
}

TEST(Esp32Mqtt, AFrameOnAnothersTopicIsNothingAndStillCounts) {
    Connected connected;
    connected.deliver("gemelo/v1/rm1/hb", rig::build_command(Command::Hold, 5), 100);
    Record record;
    ASSERT_TRUE(board.from_mqtt.front(&record));
    EXPECT_EQ(record.size, 0u);
}

TEST(Esp32Mqtt, AConfigurationIsPassedOnAsItsText) {
    Connected connected;
    const rig::Bytes text(8220, 'x');
    connected.deliver("gemelo/v1/rm1/config", text, 4096, true);
    Record record;
    ASSERT_TRUE(board.from_mqtt.front(&record));
    EXPECT_EQ(record.kind, static_cast<uint8_t>(Inbound::Config));
    EXPECT_EQ(record.size, text.size());
}

TEST(Esp32Mqtt, WhatIsForNobodyOrTooLongLeavesNoBytes) {
    Connected connected;
    connected.deliver("gemelo/v1/rm2/cmd", rig::build_command(Command::Hold, 5), 100);
    Record record;
    EXPECT_FALSE(board.from_mqtt.front(&record));
    connected.deliver("gemelo/v1/rm1/traj", rig::Bytes(9000, 1), 4096);
    ASSERT_TRUE(board.from_mqtt.front(&record));
    EXPECT_EQ(record.size, 0u);
}
