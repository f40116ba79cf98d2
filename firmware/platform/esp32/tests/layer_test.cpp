// The layer itself, from the flash and the rings to the pins, in virtual time.
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>

#include "fake_idf.h"
#include "frames.h"
#include "memory.h"
#include "running.h"
#include "store.h"

using namespace gemelo;
using fake::chip;

namespace gemelo {
Board board;
}

namespace {

constexpr int kStep = 25, kDir = 27, kEnable = 13, kEstop = 21, kLamp = 2;

bool is_high(int pin) { return (chip.outputs >> pin & 1) != 0; }

// One that has its configuration and knows where it is.
std::unique_ptr<Running> ready() {
    chip.nvs = {{"config", kConfig}};
    auto running = std::make_unique<Running>(ESP_RST_POWERON);
    running->command(Command::Reference, {0});
    return running;
}

}  // namespace

TEST(Esp32Layer, ANewBoardIsConfiguredOverTheWireAndKeepsIt) {
    chip.nvs.clear();
    Running board_without(ESP_RST_POWERON);
    EXPECT_TRUE(has(board_without.said(Output::Status), "\"joints\": 0"));
    EXPECT_EQ(chip.is_output, 0u);
    board_without.tell_over_wire(FrameType::Config, kConfig);
    EXPECT_TRUE(has(board_without.said_on_wire(), "\"accepted\": true"));
    EXPECT_EQ(chip.nvs["config"], kConfig);
    const uint64_t outputs = 1ull << kStep | 1ull << kDir | 1ull << kEnable | 1ull << kLamp;
    EXPECT_EQ(chip.is_output, outputs);
    EXPECT_TRUE(is_high(kEnable));  // the drivers are off: a new configuration wants a person
}

TEST(Esp32Layer, StatusSaysWhatIsLeftOfTheMemoryAndWhichStackCameClosestToItsEnd) {
    chip.nvs.clear();
    chip.heap_free = 71000;
    chip.heap_least = 40200;
    char slot = 0, wire = 0;
    const auto slot_task = reinterpret_cast<TaskHandle_t>(&slot), wire_task = reinterpret_cast<TaskHandle_t>(&wire);
    chip.stack_left = {{slot_task, 9000}, {wire_task, 812}};
    watch_stack(slot_task, "slot");
    watch_stack(wire_task, "wire");
    measure_memory();
    Running running(ESP_RST_POWERON);
    EXPECT_TRUE(has(running.said(Output::Status),
                    "\"heap_free\": 71000, \"heap_least\": 40200, "
                    "\"stack_least\": 812, \"stack_task\": \"wire\""));
}

TEST(Esp32Layer, AConfigurationThatTheChipCannotServeIsRefusedByName) {
    chip.nvs.clear();
    Running running(ESP_RST_POWERON);
    std::string config = kConfig;
    config.replace(config.find("\"step_pin\":25"), 13, "\"step_pin\":36");
    running.tell_over_wire(FrameType::Config, config);
    const std::string said = running.said_on_wire();
    EXPECT_TRUE(has(said, "\"accepted\": false"));
    EXPECT_TRUE(has(said, "its pin can only be an input"));
    EXPECT_EQ(chip.is_output, 0u);
    EXPECT_EQ(chip.nvs.count("config"), 0u);
}

TEST(Esp32Layer, WarnsOfAPinThatIsReadAtReset) {
    auto running = ready();
    EXPECT_TRUE(has(running->said(Output::Event), "lamp: its pin is read at reset"));
}

TEST(Esp32Layer, EveryStepOfAStreamComesOutOfItsPin) {
    auto running = ready();
    running->pass_ms(250);
    EXPECT_FALSE(is_high(kEnable));
    const uint32_t before = chip.ups[kStep];
    running->move(0, 700);
    running->pass_ms(500);
    EXPECT_EQ(chip.ups[kStep] - before, 700u);
    EXPECT_TRUE(is_high(kDir));
    running->move(700, 350);
    running->pass_ms(500);
    EXPECT_EQ(chip.ups[kStep] - before, 1050u);
    EXPECT_FALSE(is_high(kDir));
    EXPECT_TRUE(has(running->said(Output::Event), "finished"));
}

TEST(Esp32Layer, WhatAFreezeHasMissedIsNotCaughtUpAndTheArmHolds) {
    auto running = ready();
    running->pass_ms(250);
    running->move(0, 700);
    running->pass_ms(150);
    const uint32_t before = chip.ups[kStep];
    chip.now_us += 2900000;
    const rig::Bytes beat = rig::build_heartbeat(1, 100);  // came while it was frozen
    board.from_mqtt.push(static_cast<uint8_t>(Inbound::Frame), 0, chip.now_us, beat.data(), beat.size());
    running->pass_ms(500);
    EXPECT_LE(chip.ups[kStep] - before, 6u);  // two slots at 2,600 steps/s
    const std::string said = running->said(Output::Event);
    EXPECT_TRUE(has(said, "\"late\"")) << said;
    EXPECT_TRUE(has(said, "\"hold\"")) << said;
}

TEST(Esp32Layer, AQuestionThatComesWithinASlotIsAnsweredWithTimesInTheirOrder) {
    auto running = ready();
    chip.waking_us = 300;
    running->pass_ms(3);
    // The next slot begins in 1000 us, and is looked at 300 us later.
    const uint64_t asked_us = chip.now_us + 1150, answered_us = chip.now_us + 1300;
    const rig::Bytes question = rig::build_sync(5);
    board.from_mqtt.push(static_cast<uint8_t>(Inbound::Frame), 0, asked_us, question.data(), question.size());
    running->pass_ms(1);
    const std::string answer = running->said(Output::SyncReply);
    ASSERT_GE(answer.size(), 32u);
    const uint8_t* bytes = reinterpret_cast<const uint8_t*>(answer.data());
    EXPECT_EQ(load_u64(bytes + 16), asked_us);
    EXPECT_EQ(load_u64(bytes + 24), answered_us);
}

TEST(Esp32Layer, TheEstopSilencesThePinsAndTakesTheDriversPower) {
    auto running = ready();
    running->pass_ms(250);
    running->move(0, 700);
    running->pass_ms(150);
    chip.inputs |= 1ull << kEstop;
    running->pass_ms(1);
    const uint32_t at_once = chip.ups[kStep];
    running->pass_ms(100);
    EXPECT_GT(at_once, 0u);
    EXPECT_EQ(chip.ups[kStep], at_once);
    EXPECT_TRUE(is_high(kEnable));
    EXPECT_TRUE(has(running->said(Output::Event), "estop"));
}

TEST(Esp32Layer, AServoGetsItsPulsesFromTheFirstCommandOnAndNoneAfterAnotherConfiguration) {
    const std::string servo = R"(,"servo":{"name":"jaws","pin":14,"lower_us":1000,"upper_us":2000,"speed_us_s":2000}})";
    chip.nvs = {{"config", kConfig.substr(0, kConfig.size() - 1) + servo}};
    Running running(ESP_RST_POWERON);
    EXPECT_EQ(chip.servo_duty, 0u);
    EXPECT_NE(chip.is_output & 1ull << 14, 0u);
    const auto turn = [&running](uint32_t id, uint16_t pulse_us) {
        running.tell_over_mqtt(rig::build_command(Command::Servo, id, {}, rig::kNever, rig::kBoot, 0, pulse_us));
    };
    turn(900, 2000);
    EXPECT_EQ(chip.servo_pin, 14);
    EXPECT_EQ(chip.servo_hz, 50u);
    EXPECT_EQ(chip.servo_duty, 2000 * 16384 / 20000);
    turn(901, 1000);
    running.pass_ms(250);
    EXPECT_NEAR(chip.servo_duty, 1500 * 16384 / 20000, 8);
    running.pass_ms(300);
    EXPECT_NEAR(chip.servo_duty, 1000 * 16384 / 20000, 1);
    running.command(Command::Disarm);
    running.tell_over_wire(FrameType::Config, kConfig);
    EXPECT_EQ(chip.servo_duty, 0u) << running.said_on_wire();
}

TEST(Esp32Layer, AWarmResetAtRestKeepsThePlace) {
    {
        ready()->pass_ms(10);
    }
    Running again(ESP_RST_SW);
    const std::string status = again.said(Output::Status);
    EXPECT_TRUE(has(status, "\"reset_cause\": \"restart\""));
    EXPECT_TRUE(has(status, "\"referenced\": true"));
}

TEST(Esp32Layer, PowerOnAndBrownOutForgetThePlace) {
    for (const esp_reset_reason_t reason : {ESP_RST_POWERON, ESP_RST_BROWNOUT}) {
        {
            ready()->pass_ms(10);
        }
        Running again(reason);
        EXPECT_TRUE(has(again.said(Output::Status), "\"referenced\": false"));
    }
}

TEST(Esp32Layer, AResetInAMotionIsToldAndForgetsThePlace) {
    {
        auto running = ready();
        running->pass_ms(250);
        running->move(0, 700);
        running->pass_ms(100);
    }
    Running again(ESP_RST_TASK_WDT);
    const std::string status = again.said(Output::Status);
    EXPECT_TRUE(has(status, "\"reset_cause\": \"task_watchdog while moving\""));
    EXPECT_TRUE(has(status, "\"referenced\": false"));
}

TEST(Esp32Layer, NothingIsWrittenIntoTheFlashWhileTheArmMoves) {
    auto running = ready();
    running->pass_ms(250);
    const uint32_t writes = chip.flash_writes;
    running->move(0, 700);
    running->pass_ms(50);
    running->tell_over_wire(FrameType::Provision, R"({"wifi_ssid":"lab"})");
    running->tell_over_mqtt(rig::Bytes(kConfig.begin(), kConfig.end()), Inbound::Config);
    board.from_sensors.push(static_cast<uint8_t>(Inbound::FactoryReset), 0, 0, nullptr, 0);
    running->pass_ms(50);
    EXPECT_EQ(chip.flash_writes, writes);
    EXPECT_TRUE(has(running->said_on_wire(), "the arm is moving: stop it first"));
    EXPECT_FALSE(running->has_restarted());
    running->pass_ms(400);
    EXPECT_TRUE(running->has_restarted());  // the button's wish waits for rest
}

TEST(Esp32Layer, CredentialsAreKeptAndNeverSaid) {
    chip.nvs.clear();
    Running running(ESP_RST_POWERON);
    running.tell_over_wire(FrameType::Provision, R"({"device":"rm1","wifi_ssid":"lab","wifi_password":"hush-hush"})");
    const std::string said = running.said_on_wire() + running.said(Output::Event) + running.said(Output::Status);
    EXPECT_TRUE(has(said, "\"accepted\": true"));
    EXPECT_FALSE(has(said, "hush"));
    EXPECT_STREQ(chip.nvs["wifi_password"].c_str(), "hush-hush");
    running.pass_ms(400);
    EXPECT_TRUE(running.has_restarted());
}

TEST(Esp32Layer, ACertificateOfTheBoardsOwnIsKeptWithItsKeyAndNotWithoutIt) {
    chip.nvs.clear();
    Running running(ESP_RST_POWERON);
    running.tell_over_wire(FrameType::Provision, R"({"mqtt_certificate":"CERTIFICATE"})");
    EXPECT_TRUE(has(running.said_on_wire(), "belong together"));
    EXPECT_EQ(chip.nvs.count("mqtt_cert"), 0u);
    running.tell_over_wire(FrameType::Provision, R"({"mqtt_certificate":"CERTIFICATE","mqtt_key":"KEY"})");
    const std::string said = running.said_on_wire();
    EXPECT_TRUE(has(said, "\"accepted\": true"));
    EXPECT_FALSE(has(said, "KEY"));
    Credentials kept;
    load_credentials(&kept);
    EXPECT_STREQ(kept.mqtt_certificate, "CERTIFICATE");
    EXPECT_STREQ(kept.mqtt_key, "KEY");
    for (const auto& [key, value] : chip.nvs) EXPECT_LE(key.size(), 15u) << key;  // as NVS has it
}

TEST(Esp32Layer, AFactoryResetForgetsAll) {
    chip.nvs = {{"config", kConfig}, {"wifi_password", "hush-hush"}};
    Running running(ESP_RST_POWERON);
    running.tell_over_wire(FrameType::Provision, R"({"factory_reset":true})");
    EXPECT_TRUE(chip.nvs.empty()) << running.said_on_wire();
    running.pass_ms(400);
    EXPECT_TRUE(running.has_restarted());
}

TEST(Esp32Layer, AConfigurationInTheFlashThatIsNoneLeavesTheBoardWithoutOne) {
    chip.nvs = {{"config", "{\"name\":"}};
    Running running(ESP_RST_POWERON);
    EXPECT_TRUE(has(running.said(Output::Status), "\"joints\": 0"));
}
