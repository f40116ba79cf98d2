#include "packets.h"

#include "protocol.h"
#include "text_line.h"

namespace gemelo {
namespace {

bool is_end_of_line(uint8_t byte) { return byte == '\n' || byte == '\r'; }

}  // namespace

Packets::Found Packets::put(uint8_t byte) {
    switch (state_) {
        case State::Begin:
            // An empty packet is none.
            if (byte != 0) state_ = State::First;
            first_ = byte;
            return Found::None;
        case State::First:
            return put_second(byte);
        case State::Frame:
            return put_frame(byte);
        case State::Line:
            return put_line(byte);
        case State::Garbage:
            return byte == 0 || byte == '\n' ? end(Found::Bad) : Found::None;
    }
    return Found::None;
}

Packets::Found Packets::pause() {
    const bool is_empty = state_ == State::Begin || (state_ == State::First && is_end_of_line(first_));
    return end(is_empty ? Found::None : Found::Bad);
}

// The second byte tells a line of text from a frame, and an end of line from a block's code.
Packets::Found Packets::put_second(uint8_t byte) {
    size_ = 0;
    if (first_ == '<' && byte >= '0' && byte <= '9') {
        state_ = State::Line;
        bytes_[size_++] = first_;
        return put_line(byte);
    }
    if (is_end_of_line(first_) && byte != kMagic) {
        state_ = State::Begin;
        return put(byte);
    }
    state_ = State::Frame;
    cobs_.begin();
    append_frame(first_);
    return put_frame(byte);
}

Packets::Found Packets::put_frame(uint8_t byte) {
    if (byte == 0) return end(cobs_.is_whole() ? Found::Frame : Found::Bad);
    return append_frame(byte);
}

Packets::Found Packets::append_frame(uint8_t byte) {
    uint8_t decoded = 0;
    if (!cobs_.put(byte, &decoded)) return Found::None;
    // Known early, so that what is no frame cannot swallow the lines after it.
    const bool is_frame = size_ != 0 || decoded == kMagic;
    if (!is_frame || size_ == kMaxFrame) {
        state_ = State::Garbage;
        return put(byte);
    }
    bytes_[size_++] = decoded;
    return Found::None;
}

Packets::Found Packets::put_line(uint8_t byte) {
    if (byte == 0) return end(Found::Bad);
    if (byte == '\n') {
        if (bytes_[size_ - 1] == '\r') --size_;
        return end(size_ <= kMaxTextLine ? Found::Line : Found::Bad);
    }
    // One more than a line may have: a '\r' before its end.
    if (size_ > kMaxTextLine) {
        state_ = State::Garbage;
    } else {
        bytes_[size_++] = byte;
    }
    return Found::None;
}

Packets::Found Packets::end(Found found) {
    state_ = State::Begin;
    return found;
}

}  // namespace gemelo
