// The bytes of a serial line, cut into packets and lines of text.
//
// A packet is COBS between two 0x00; one that begins with '<' and a digit is a line of text. What is neither ends at
// the next 0x00 or end of line: garbage costs itself, and what it has swallowed.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "cobs.h"

namespace gemelo {

constexpr size_t kMaxFrame = 8232;  // [bytes] chosen: a chunk of 128 knots of 8 joints fits

class Packets {
  public:
    enum class Found : uint8_t { None, Frame, Line, Bad };

    // What ends with this byte; its content stays until the next call.
    Found put(uint8_t byte);
    // The line was silent: what has begun will not end.
    Found pause();

    const uint8_t* bytes() const { return bytes_; }
    size_t size() const { return size_; }

  private:
    enum class State : uint8_t { Begin, First, Frame, Line, Garbage };

    Found put_second(uint8_t byte);
    Found put_frame(uint8_t byte);
    Found put_line(uint8_t byte);
    Found end(Found found);
    Found append_frame(uint8_t byte);

    State state_ = State::Begin;
    uint8_t first_ = 0;  // byte of what has begun
    CobsReader cobs_;
    size_t size_ = 0;
    uint8_t bytes_[kMaxFrame];
};

}  // namespace gemelo
