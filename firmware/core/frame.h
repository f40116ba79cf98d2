// Frames: header, body and CRC as bytes; nothing here knows what a frame means.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "protocol.h"

namespace gemelo {

constexpr size_t kHeaderSize = 8;  // standard: PROTOCOL.md
constexpr size_t kCrcSize = 4;     // standard: CRC-32

// A received frame whose magic, version and CRC are right. `size` counts all bytes but the CRC.
struct Frame {
    const uint8_t* bytes = nullptr;
    size_t size = 0;

    FrameType type() const { return static_cast<FrameType>(bytes[2]); }
    uint8_t joints() const { return bytes[3]; }
    uint32_t boot_id() const;
    bool is_valid() const { return bytes != nullptr; }
};

Frame open_frame(const uint8_t* bytes, size_t size);

void write_header(uint8_t* bytes, FrameType type, uint8_t joints, uint32_t boot_id);

// Appends the CRC of the first `size` bytes; returns the whole length.
size_t seal_frame(uint8_t* bytes, size_t size);

}  // namespace gemelo
