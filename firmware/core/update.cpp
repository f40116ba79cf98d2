#include "update.h"

#include <string.h>

#include "bytes.h"
#include "phrase.h"
#include "report.h"

namespace gemelo {
namespace {

constexpr size_t kContent = kHeaderSize + 12;  // where a step's own bytes begin; standard: PROTOCOL.md
constexpr size_t kLeastBegin = sizeof(uint32_t) + kDigestSize + 8;  // the shortest signature has 8 bytes

bool refuse(Refusal* refusal, const char* reason) {
    Phrase(refusal->reason, sizeof refusal->reason).add(reason);
    return false;
}

bool are_equal(const uint8_t* digest, const uint8_t* other) {
    for (size_t i = 0; i < kDigestSize; ++i)
        if (digest[i] != other[i]) return false;
    return true;
}

struct Version {
    uint32_t part[3] = {0, 0, 0};
};

// Up to three numbers with points between them, as 1.0.0; what follows them does not count. False for none.
bool read_version(const char* text, Version* version) {
    size_t at = 0;
    bool has_any = false;
    for (uint32_t& part : version->part) {
        size_t digits = 0;
        for (; digits < 6 && at < kImageVersionSize && text[at] >= '0' && text[at] <= '9'; ++at, ++digits)
            part = 10 * part + static_cast<uint32_t>(text[at] - '0');
        has_any = has_any || digits != 0;
        if (digits == 0 || at >= kImageVersionSize || text[at] != '.') break;
        ++at;
    }
    return has_any;
}

bool is_older(const Version& version, const Version& other) {
    for (int i = 0; i < 3; ++i)
        if (version.part[i] != other.part[i]) return version.part[i] < other.part[i];
    return false;
}

void add_version(Phrase& phrase, const Version& version) {
    phrase.add(version.part[0]).add(".").add(version.part[1]).add(".").add(version.part[2]);
}

bool has_right_size(UpdateStep step, size_t size) {
    switch (step) {
        case UpdateStep::Begin:
            return size >= kLeastBegin && size <= sizeof(uint32_t) + kDigestSize + kMaxSignature;
        case UpdateStep::Data:
            return size > 0 && size <= kMaxUpdatePiece;
        case UpdateStep::End:
        case UpdateStep::Abort:
            return size == 0;
    }
    return false;
}

}  // namespace

bool UpdateReceiver::receive(const Frame& frame, uint32_t boot_id, bool is_retained, bool is_free,
                             UpdateAnswer* answer) {
    if (frame.size < kContent) return false;
    if (!has_right_size(static_cast<UpdateStep>(frame.bytes[16]), frame.size - kContent)) return false;
    Refusal* refusal = &answer->refusal;
    answer->session = load_u32(frame.bytes + 8);
    if (is_retained) {
        refuse(refusal, "a retained update is never carried out");
    } else if (frame.boot_id() != boot_id) {
        refuse(refusal, "the device has restarted meanwhile: begin the transfer again");
    } else if (slot_ == nullptr || slot_->verify == nullptr) {
        refuse(refusal, "this device takes no firmware over the wire");
    } else if (!is_free) {
        refuse(refusal, "the device is armed: disarm it first");
    } else {
        answer->is_accepted = carry_out(frame, refusal);
    }
    answer->is_receiving = state_ == State::Receiving && answer->session == session_;
    answer->next = answer->session == session_ ? received_ : 0;
    return true;
}

bool UpdateReceiver::carry_out(const Frame& frame, Refusal* refusal) {
    const uint32_t session = load_u32(frame.bytes + 8), offset = load_u32(frame.bytes + 12);
    const uint8_t* content = frame.bytes + kContent;
    const size_t size = frame.size - kContent;
    switch (static_cast<UpdateStep>(frame.bytes[16])) {
        case UpdateStep::Begin:
            return begin_transfer(frame, content, size, refusal);
        case UpdateStep::Data:
            return take(session, offset, content, size, refusal);
        case UpdateStep::End:
            return end_transfer(session, refusal);
        case UpdateStep::Abort:
            if (!is_current(session, refusal)) return false;
            give_up();
            return true;
    }
    return refuse(refusal, "there is no such step of an update");
}

// A transfer that was cut off goes on where it ended, whoever sends the same image.
bool UpdateReceiver::begin_transfer(const Frame& frame, const uint8_t* content, size_t size, Refusal* refusal) {
    const uint32_t session = load_u32(frame.bytes + 8), image_size = load_u32(content);
    const uint8_t* digest = content + sizeof image_size;
    if (session == 0) return refuse(refusal, "0 is no session: choose another number");
    if (state_ == State::Ready) return refuse(refusal, "a new firmware is there already, and starts now");
    if (image_size < kImageHeaderSize) return refuse(refusal, "this is too short for an image of a firmware");
    const uint8_t* signature = digest + kDigestSize;
    if (!is_permitted(frame, digest, signature, size - sizeof image_size - kDigestSize, refusal)) return false;
    const bool is_same = state_ == State::Receiving && image_size == size_ && are_equal(digest, digest_);
    if (!is_same) {
        give_up();
        if (!slot_->begin(slot_->context, image_size, refusal)) return false;
        state_ = State::Receiving;
        size_ = image_size;
        memcpy(digest_, digest, kDigestSize);
    }
    session_ = session;
    return true;
}

// Either signature is by the key's owner: that of the image, or that of the leave to go back to it.
bool UpdateReceiver::is_permitted(const Frame& frame, const uint8_t* digest, const uint8_t* signature, size_t size,
                                  Refusal* refusal) {
    may_be_older_ = false;
    if (slot_->verify(slot_->context, digest, signature, size, refusal)) return true;
    may_be_older_ = slot_->permits_older != nullptr &&
                    slot_->permits_older(slot_->context, digest, frame.boot_id(), signature, size);
    if (may_be_older_) *refusal = Refusal{};
    return may_be_older_;
}

bool UpdateReceiver::take(uint32_t session, uint32_t offset, const uint8_t* bytes, size_t size, Refusal* refusal) {
    if (!is_current(session, refusal)) return false;
    if (!fits(offset, size, refusal)) return false;
    if (offset + size <= received_) return true;  // a piece that came already
    if (offset != received_) {
        Phrase(refusal->reason, sizeof refusal->reason).add("a piece is missing: send from byte ").add(received_);
        return false;
    }
    const bool is_taken = offset != 0 || (is_for_this_chip(bytes, size, refusal) && is_new_enough(bytes, refusal));
    const bool is_good = is_taken && slot_->write(slot_->context, bytes, size, refusal);
    if (is_good)
        received_ += static_cast<uint32_t>(size);
    else
        give_up();
    return is_good;
}

bool UpdateReceiver::fits(uint32_t offset, size_t size, Refusal* refusal) const {
    if (offset <= size_ && size <= size_ - offset) return true;
    Phrase(refusal->reason, sizeof refusal->reason)
        .add("this piece ends behind the ")
        .add(size_)
        .add(" bytes that were announced");
    return false;
}

bool UpdateReceiver::is_for_this_chip(const uint8_t* bytes, size_t size, Refusal* refusal) const {
    if (size < kImageVersionOffset + kImageVersionSize || bytes[0] != kImageMagic)
        return refuse(refusal, "this is no image of a firmware: its first byte is not 0xE9, or its header is cut off");
    const uint16_t chip_id = load_u16(bytes + kImageChipOffset);
    if (chip_id == slot_->chip_id) return true;
    Phrase(refusal->reason, sizeof refusal->reason)
        .add("this image is for another chip: for number ")
        .add(chip_id)
        .add(", this one is ")
        .add(slot_->chip_id);
    return false;
}

bool UpdateReceiver::is_new_enough(const uint8_t* bytes, Refusal* refusal) const {
    Version version, running;
    const bool has_version = read_version(reinterpret_cast<const char*>(bytes) + kImageVersionOffset, &version);
    read_version(kFirmwareVersion, &running);
    if (may_be_older_ || (has_version && !is_older(version, running))) return true;
    if (!has_version) return refuse(refusal, "its version is no number: `gemelo device update --downgrade` sends it");
    Phrase phrase(refusal->reason, sizeof refusal->reason);
    add_version(phrase.add("its version "), version);
    add_version(phrase.add(" is older than what runs, "), running);
    phrase.add(": `gemelo device update --downgrade` sends it");
    return false;
}

bool UpdateReceiver::end_transfer(uint32_t session, Refusal* refusal) {
    if (state_ == State::Ready && session == session_) return true;  // the answer was lost
    if (!is_current(session, refusal)) return false;
    if (received_ != size_) {
        Phrase(refusal->reason, sizeof refusal->reason).add("a piece is missing: send from byte ").add(received_);
        return false;
    }
    const bool is_good = slot_->finish(slot_->context, digest_, refusal);
    state_ = is_good ? State::Ready : State::Idle;
    if (!is_good) received_ = 0;
    return is_good;
}

bool UpdateReceiver::is_current(uint32_t session, Refusal* refusal) const {
    if (state_ != State::Receiving) return refuse(refusal, "no transfer is under way: begin it again");
    if (session == session_) return true;
    return refuse(refusal, "another transfer has begun since: this one is over");
}

void UpdateReceiver::give_up() {
    if (state_ == State::Receiving) slot_->abort(slot_->context);
    state_ = State::Idle;
    received_ = 0;
}

}  // namespace gemelo
