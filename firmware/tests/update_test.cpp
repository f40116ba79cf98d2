// A new firmware over the wire: taken in its order, once, only while the drivers are off; everything else is refused.
#include "update.h"

#include <gtest/gtest.h>

#include <string>

#include "bytes.h"
#include "phrase.h"
#include "rig.h"

using namespace gemelo;
using rig::build_update;
using rig::build_update_begin;
using rig::Bytes;

namespace {

constexpr uint16_t kChip = 9;
constexpr size_t kSize = 10000;

Bytes image(uint16_t chip = kChip, const std::string& version = "1.0.0") {
    Bytes bytes(kSize);
    for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<uint8_t>(i * 7);
    bytes[0] = kImageMagic;
    store_u16(&bytes[kImageChipOffset], chip);
    for (size_t i = 0; i < kImageVersionSize; ++i)
        bytes[kImageVersionOffset + i] = i < version.size() ? static_cast<uint8_t>(version[i]) : 0;
    return bytes;
}

Bytes piece(const Bytes& of, size_t from, size_t size) {
    return Bytes(of.begin() + static_cast<long>(from), of.begin() + static_cast<long>(from + size));
}

// A flash in memory; a digest is good if it is that of the test's image, a signature if its bytes are 0x30.
struct Flash {
    Bytes written;
    uint32_t announced = 0;
    bool is_open = false, is_full = false, is_damaged = false;
    int begun = 0, verified = 0, finished = 0, aborted = 0;

    static Flash& of(void* self) { return *static_cast<Flash*>(self); }
    static bool say(bool is_good, const char* reason, Refusal* refusal) {
        if (!is_good) Phrase(refusal->reason, sizeof refusal->reason).add(reason);
        return is_good;
    }
    static bool verify(void* self, const uint8_t*, const uint8_t* signature, size_t, Refusal* refusal) {
        ++of(self).verified;
        return say(signature[0] == 0x30, "its signature is not by the key of this device", refusal);
    }
    static bool begin(void* self, uint32_t size, Refusal* refusal) {
        Flash& flash = of(self);
        flash.written.clear();
        flash.announced = size;
        flash.is_open = true;
        ++flash.begun;
        return say(size < 1000000, "it is larger than the slot", refusal);
    }
    static bool write(void* self, const uint8_t* bytes, size_t size, Refusal* refusal) {
        Flash& flash = of(self);
        flash.written.insert(flash.written.end(), bytes, bytes + size);
        return say(!flash.is_full, "the flash cannot be written", refusal);
    }
    static bool finish(void* self, const uint8_t*, Refusal* refusal) {
        Flash& flash = of(self);
        flash.is_open = false;
        ++flash.finished;
        return say(!flash.is_damaged, "its checksum is not that of what was signed", refusal);
    }
    static void abort(void* self) {
        of(self).is_open = false;
        ++of(self).aborted;
    }
    // 0x32 is the leave of the key's owner.
    static bool permits_older(void*, const uint8_t*, uint32_t, const uint8_t* signature, size_t) {
        return signature[0] == 0x32;
    }
};

class Update : public testing::Test {
  protected:
    Update() {
        device.device.firmware() = {&flash,       kChip,         Flash::verify, Flash::begin,
                                    Flash::write, Flash::finish, Flash::abort,  Flash::permits_older};
        device.command(Command::Disarm);
        device.run_ms(5);
    }
    // What the device answers, or an empty text.
    std::string send(const Bytes& frame, bool retained = false) {
        device.device.outputs().clear();
        device.device.receive(frame.data(), frame.size(), retained, device.device.now_us());
        std::string answer;
        for (const OutFrame& said : device.device.outputs())
            if (said.output == Output::UpdateAck) answer.assign(said.payload.begin(), said.payload.end());
        return answer;
    }
    std::string begin(uint32_t session = 5, uint32_t size = kSize) {
        return send(build_update(UpdateStep::Begin, session, 0, build_update_begin(size, 1)));
    }
    std::string data(size_t from, size_t size, uint32_t session = 5, const Bytes& of = image()) {
        return send(build_update(UpdateStep::Data, session, static_cast<uint32_t>(from), piece(of, from, size)));
    }
    std::string end(uint32_t session = 5) { return send(build_update(UpdateStep::End, session)); }

    rig::Rig device;
    Flash flash;
};

std::string taken(uint32_t next, bool is_receiving = true, uint32_t session = 5) {
    return "{\"session\": " + std::to_string(session) + ", \"next\": " + std::to_string(next) +
           ", \"accepted\": true, \"receiving\": " + (is_receiving ? "true" : "false") + ", \"reason\": \"\"}";
}

bool refuses(const std::string& answer, const std::string& reason) {
    return answer.find("\"accepted\": false") != std::string::npos && answer.find(reason) != std::string::npos;
}

}  // namespace

TEST_F(Update, AnImageArrivesWholeAndIsFinishedOnce) {
    EXPECT_EQ(begin(), taken(0));
    EXPECT_EQ(data(0, 4096), taken(4096));
    EXPECT_EQ(data(4096, 4096), taken(8192));
    EXPECT_EQ(data(8192, 1808), taken(10000));
    EXPECT_EQ(end(), taken(10000, false));
    EXPECT_EQ(end(), taken(10000, false));  // its answer was lost
    EXPECT_EQ(flash.written, image());
    EXPECT_EQ(flash.announced, kSize);
    EXPECT_EQ(flash.finished, 1);
    EXPECT_TRUE(refuses(begin(6), "starts now"));
}

TEST_F(Update, ARepeatedPieceIsTakenOnceAndALostOneIsAskedForAgain) {
    begin();
    data(0, 1000);
    EXPECT_EQ(data(0, 1000), taken(1000));
    EXPECT_TRUE(refuses(data(2000, 1000), "a piece is missing: send from byte 1000"));
    EXPECT_TRUE(refuses(data(500, 1000), "send from byte 1000"));
    EXPECT_TRUE(refuses(end(), "send from byte 1000"));
    EXPECT_EQ(data(1000, 1000), taken(2000));
    EXPECT_EQ(flash.written, piece(image(), 0, 2000));
    EXPECT_EQ(flash.finished, 0);
}

TEST_F(Update, ATransferThatWasCutOffGoesOnWhereItEndedAndTheOldSessionIsOver) {
    begin(5);
    data(0, 3000);
    EXPECT_EQ(begin(5), taken(3000));  // its answer was lost
    EXPECT_EQ(begin(6), taken(3000, true, 6));
    EXPECT_EQ(flash.begun, 1);
    EXPECT_TRUE(refuses(data(3000, 1000, 5), "another transfer has begun since"));
    EXPECT_EQ(data(3000, 1000, 6), taken(4000, true, 6));
}

TEST_F(Update, AnotherImageBeginsAnew) {
    begin(5);
    data(0, 3000);
    EXPECT_EQ(send(build_update(UpdateStep::Begin, 6, 0, build_update_begin(kSize, 2))), taken(0, true, 6));
    EXPECT_EQ(flash.aborted, 1);
    EXPECT_EQ(flash.begun, 2);
}

TEST_F(Update, AnArmedDeviceTakesNothingAndWhatWasReceivedWaits) {
    begin();
    data(0, 1000);
    device.command(Command::Arm);
    device.run_ms(5);
    EXPECT_TRUE(refuses(data(1000, 1000), "the device is armed: disarm it first"));
    EXPECT_TRUE(refuses(begin(7), "armed"));
    EXPECT_TRUE(refuses(end(), "armed"));
    EXPECT_EQ(flash.written.size(), 1000u);
    device.command(Command::Disarm);
    device.run_ms(5);
    EXPECT_EQ(data(1000, 1000), taken(2000));
}

TEST_F(Update, AWrongSignatureIsRefusedBeforeAnythingIsWritten) {
    Bytes content = build_update_begin(kSize, 1);
    content[4 + kDigestSize] = 0x31;
    const std::string said = send(build_update(UpdateStep::Begin, 5, 0, content));
    EXPECT_TRUE(refuses(said, "its signature is not by the key of this device")) << said;
    EXPECT_EQ(flash.begun, 0);
    EXPECT_TRUE(refuses(data(0, 1000), "no transfer is under way"));
}

TEST_F(Update, AnImageForAnotherChipAndWhatIsNoneAreRefusedWithTheFirstPiece) {
    begin();
    EXPECT_TRUE(refuses(data(0, 1000, 5, image(5)), "this image is for another chip: for number 5, this one is 9"));
    EXPECT_EQ(flash.aborted, 1);
    begin();
    EXPECT_TRUE(refuses(data(0, 1000, 5, Bytes(kSize, 1)), "this is no image of a firmware"));
    begin();
    EXPECT_TRUE(refuses(data(0, 23), "this is no image of a firmware"));
    EXPECT_TRUE(flash.written.empty());
    EXPECT_TRUE(refuses(begin(5, 23), "too short"));
    EXPECT_TRUE(refuses(begin(5, 2000000), "it is larger than the slot"));
}

TEST_F(Update, AnOlderImageIsRefusedAndANewerOrTheSameIsTaken) {
    const auto first_piece = [&](const std::string& version) {
        begin();
        return data(0, 1000, 5, image(kChip, version));
    };
    for (const char* version : {"0.9.9", "0.10.0", "0", "0.9.9-rc1"}) {
        const std::string said = first_piece(version);
        EXPECT_TRUE(refuses(said, "is older than what runs, 1.0.0: `gemelo device update --downgrade` sends it"))
            << said;
    }
    EXPECT_TRUE(refuses(first_piece("0.9.9"), "its version 0.9.9 is older"));
    for (const char* version : {"", "unknown", "v1.0.0", ".1"})
        EXPECT_TRUE(refuses(first_piece(version), "its version is no number")) << version;
    EXPECT_TRUE(flash.written.empty());
    for (const char* version : {"1.0.0", "1", "1.0", "1.0.0-dirty", "1.0.1", "1.10.0", "2.0.0", "10.0.0"}) {
        EXPECT_FALSE(refuses(first_piece(version), "")) << version;
        send(build_update(UpdateStep::Abort, 5));
    }
}

TEST_F(Update, AnOlderImageIsTakenByLeaveOfTheKeysOwner) {
    Bytes content = build_update_begin(kSize, 1);
    content[4 + kDigestSize] = 0x32;
    EXPECT_EQ(send(build_update(UpdateStep::Begin, 5, 0, content)), taken(0));
    EXPECT_EQ(data(0, 1000, 5, image(kChip, "0.1.0")), taken(1000));
    // And not by that of another image.
    EXPECT_EQ(send(build_update(UpdateStep::Begin, 5, 0, build_update_begin(kSize, 2))), taken(0));
    EXPECT_TRUE(refuses(data(0, 1000, 5, image(kChip, "0.1.0")), "is older than what runs"));
}

TEST_F(Update, ADamagedImageIsNotStarted) {
    flash.is_damaged = true;
    begin();
    for (size_t at = 0; at < kSize; at += 1000) data(at, 1000);
    EXPECT_TRUE(refuses(end(), "its checksum is not that of what was signed"));
    EXPECT_TRUE(refuses(end(), "no transfer is under way"));
}

TEST_F(Update, AFlashThatCannotBeWrittenEndsTheTransfer) {
    begin();
    flash.is_full = true;
    EXPECT_TRUE(refuses(data(0, 1000), "the flash cannot be written"));
    EXPECT_TRUE(refuses(data(0, 1000), "no transfer is under way"));
    EXPECT_FALSE(flash.is_open);
}

TEST_F(Update, WhatIsRetainedOfAnotherBootOrForNobodyIsRefused) {
    const Bytes frame = build_update(UpdateStep::Begin, 5, 0, build_update_begin(kSize, 1));
    EXPECT_TRUE(refuses(send(frame, true), "retained"));
    const Bytes other = build_update(UpdateStep::Begin, 5, 0, build_update_begin(kSize, 1), 99);
    EXPECT_TRUE(refuses(send(other), "the device has restarted meanwhile"));
    EXPECT_TRUE(refuses(begin(0), "0 is no session"));
    device.device.firmware() = {};
    EXPECT_TRUE(refuses(send(frame), "takes no firmware over the wire"));
    EXPECT_EQ(flash.verified, 0);
}

TEST_F(Update, WhatGoesBehindItsEndIsRefusedAndTheTransferGoesOn) {
    begin(5, 1500);
    data(0, 1000);
    EXPECT_TRUE(refuses(data(1000, 1000), "this piece ends behind the 1500 bytes that were announced"));
    EXPECT_TRUE(refuses(data(9000, 1000), "behind"));
    EXPECT_EQ(data(1000, 500), taken(1500));
    EXPECT_EQ(send(build_update(UpdateStep::Abort, 5)), taken(0, false));
    EXPECT_EQ(flash.aborted, 1);
}

TEST_F(Update, AFrameThatIsNoneIsCountedAndNotAnswered) {
    const uint32_t before = device.state().bad_frames;
    begin();
    EXPECT_EQ(send(build_update(UpdateStep::Data, 5, 0, {})), "");
    EXPECT_EQ(send(build_update(UpdateStep::Data, 5, 0, Bytes(4097))), "");
    EXPECT_EQ(send(build_update(UpdateStep::End, 5, 0, {1})), "");
    EXPECT_EQ(send(build_update(static_cast<UpdateStep>(9), 5)), "");
    Bytes begin_frame = build_update_begin(kSize, 1);
    begin_frame.resize(4 + kDigestSize + kMaxSignature + 1);
    EXPECT_EQ(send(build_update(UpdateStep::Begin, 5, 0, begin_frame)), "");
    device.run_ms(50);
    EXPECT_EQ(device.state().bad_frames - before, 5u);
}
