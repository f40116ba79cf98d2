// Updates in the layer itself: its flash, its signatures, its restarts and its trials, in virtual time.
#include <gtest/gtest.h>

#include <string>

#include "bytes.h"
#include "fake_idf.h"
#include "frames.h"
#include "openssl.h"
#include "running.h"

using namespace gemelo;
using fake::chip;

namespace {

constexpr size_t kPiece = 4000;

const fake::Key& key() {
    static const fake::Key made;
    return made;
}

std::string image(uint16_t chip_id = 0, size_t size = 9000, const std::string& version = "1.0.0") {
    std::string bytes(size, 'x');
    bytes[0] = static_cast<char>(kImageMagic);
    bytes[kImageChipOffset] = static_cast<char>(chip_id);
    bytes[kImageChipOffset + 1] = 0;
    bytes.replace(kImageVersionOffset, version.size() + 1, version.c_str(), version.size() + 1);
    return bytes;
}

rig::Bytes bytes_of(const std::string& text) { return rig::Bytes(text.begin(), text.end()); }

rig::Bytes announced(const std::string& image, const std::string& signature) {
    rig::Bytes content(4);
    store_u32(content.data(), static_cast<uint32_t>(image.size()));
    const std::string rest = fake::sha256(image) + signature;
    content.insert(content.end(), rest.begin(), rest.end());
    return content;
}

class Updated : public testing::Test {
  protected:
    Updated() {
        chip.flash = {};
        chip.nvs = {{"config", kConfig}, {"update_key", key().shown + '\0'}};
        start(ESP_RST_POWERON);
    }
    void start(esp_reset_reason_t reason) {
        running.reset();
        running = std::make_unique<Running>(reason);
        running->command(Command::Disarm);
    }
    std::string tell(UpdateStep step, uint32_t offset = 0, const rig::Bytes& content = {}) {
        running->tell_over_mqtt(rig::build_update(step, 5, offset, content));
        return running->said(Output::UpdateAck);
    }
    std::string begin(const std::string& what) { return tell(UpdateStep::Begin, 0, announced(what, key().sign(what))); }
    std::string send(const std::string& what) {
        std::string said;
        for (size_t at = 0; at < what.size(); at += kPiece)
            said = tell(UpdateStep::Data, static_cast<uint32_t>(at), bytes_of(what.substr(at, kPiece)));
        return said;
    }
    void update() {
        begin(image());
        send(image());
        EXPECT_TRUE(has(tell(UpdateStep::End), "\"accepted\": true"));
        running->pass_ms(400);
        EXPECT_TRUE(running->has_restarted());
    }
    bool is_status_from(const std::string& slot) {
        return has(running->said(Output::Status), "\"slot\": \"" + slot + "\"");
    }

    std::unique_ptr<Running> running;
};

}  // namespace

TEST_F(Updated, ASignedImageIsWrittenIntoTheOtherSlotAndStarted) {
    EXPECT_TRUE(is_status_from("ota_0"));
    update();
    EXPECT_EQ(chip.flash.slot[1], image());
    EXPECT_EQ(chip.flash.slot[0], "");
    start(ESP_RST_SW);
    EXPECT_TRUE(is_status_from("ota_1"));
}

TEST_F(Updated, WhatHasSaidStatusToSomebodyStays) {
    update();
    start(ESP_RST_SW);
    EXPECT_EQ(chip.flash.state, ESP_OTA_IMG_PENDING_VERIFY);
    EXPECT_TRUE(has(begin(image()), "is on trial itself"));
    board.from_mqtt.push(static_cast<uint8_t>(Inbound::Connected), 0, chip.now_us, nullptr, 0);
    running->pass_ms(5);
    EXPECT_EQ(chip.flash.state, ESP_OTA_IMG_VALID);
    running->pass_ms(31000);
    EXPECT_FALSE(running->has_restarted());
    start(ESP_RST_SW);
    EXPECT_TRUE(is_status_from("ota_1"));
}

TEST_F(Updated, OverTheWireStatusIsSaidToWhoeverHasSpoken) {
    update();
    start(ESP_RST_SW);
    running->pass_ms(1000);
    EXPECT_EQ(chip.flash.state, ESP_OTA_IMG_PENDING_VERIFY);
    running->tell_over_wire(FrameType::Config, kConfig);
    EXPECT_EQ(chip.flash.state, ESP_OTA_IMG_VALID);
}

TEST_F(Updated, WhatSaysStatusToNobodyFor30SecondsGivesWayToTheOneBefore) {
    update();
    start(ESP_RST_SW);
    running->pass_ms(29900);
    EXPECT_FALSE(running->has_restarted());
    running->pass_ms(200);
    EXPECT_TRUE(running->has_restarted());
    start(ESP_RST_SW);
    EXPECT_TRUE(is_status_from("ota_0"));
}

TEST_F(Updated, WhatResetsBeforeItHasSaidStatusGivesWayToo) {
    update();
    start(ESP_RST_SW);
    start(ESP_RST_PANIC);
    EXPECT_TRUE(is_status_from("ota_0"));
}

TEST_F(Updated, ASignatureByAnotherKeyOrOfAnotherImageIsRefusedAndNothingIsWritten) {
    const fake::Key other;
    const char* const reason = "its signature is not by the key that this device was provisioned with";
    EXPECT_TRUE(has(tell(UpdateStep::Begin, 0, announced(image(), other.sign(image()))), reason));
    EXPECT_TRUE(has(tell(UpdateStep::Begin, 0, announced(image(), key().sign(image(0, 9001)))), reason));
    chip.nvs.erase("update_key");
    start(ESP_RST_POWERON);
    EXPECT_TRUE(has(begin(image()), "it has no key for updates"));
    EXPECT_EQ(chip.flash.slot[1], "");
}

TEST_F(Updated, AnOlderImageIsWrittenByASignedLeaveForThisBootOnly) {
    const std::string older = image(0, 9000, "0.9.0");
    begin(older);
    EXPECT_TRUE(has(tell(UpdateStep::Data, 0, bytes_of(older.substr(0, kPiece))),
                    "its version 0.9.0 is older than what runs, 1.0.0"));
    EXPECT_EQ(chip.flash.slot[1], "");
    const auto leave = [&](uint32_t boot_id) {
        std::string boot(4, 0);
        store_u32(reinterpret_cast<uint8_t*>(boot.data()), boot_id);
        return announced(older, key().sign(fake::sha256(older) + "older" + boot));
    };
    EXPECT_TRUE(has(tell(UpdateStep::Begin, 0, leave(rig::kBoot + 1)), "its signature is not by the key"));
    EXPECT_TRUE(has(tell(UpdateStep::Begin, 0, leave(rig::kBoot)), "\"accepted\": true"));
    send(older);
    EXPECT_TRUE(has(tell(UpdateStep::End), "\"accepted\": true"));
    EXPECT_EQ(chip.flash.slot[1], older);
}

TEST_F(Updated, AnImageThatWasDamagedOrIsNoneOrForAnotherChipOrTooLargeIsNotStarted) {
    begin(image());
    std::string damaged = image();
    damaged[5000] = 'y';
    send(damaged);
    EXPECT_TRUE(has(tell(UpdateStep::End), "its checksum is not that of what was signed"));
    EXPECT_FALSE(chip.flash.is_open);
    begin(image(9));
    EXPECT_TRUE(has(tell(UpdateStep::Data, 0, bytes_of(image(9, 4000))), "for another chip: for number 9"));
    EXPECT_FALSE(chip.flash.is_open);
    chip.flash.is_valid = false;
    begin(image());
    send(image());
    EXPECT_TRUE(has(tell(UpdateStep::End), "ESP-IDF finds no image in it"));
    EXPECT_TRUE(has(begin(image(0, 0x1e0001)), "it has 1966081 bytes, the slot 1966080"));
    EXPECT_EQ(chip.flash.boot, 0);
    running->pass_ms(1000);
    EXPECT_FALSE(running->has_restarted());
}

TEST_F(Updated, NothingIsWrittenWhileTheDriversAreOnAndTheRestartWaitsForThem) {
    begin(image());
    running->command(Command::Arm);
    EXPECT_TRUE(has(tell(UpdateStep::Data, 0, bytes_of(image().substr(0, kPiece))), "the device is armed"));
    EXPECT_EQ(chip.flash.slot[1], "");
    running->command(Command::Disarm);
    send(image());
    tell(UpdateStep::End);
    running->command(Command::Arm);
    running->pass_ms(1000);
    EXPECT_FALSE(running->has_restarted());
    running->command(Command::Disarm);
    running->pass_ms(400);
    EXPECT_TRUE(running->has_restarted());
}
