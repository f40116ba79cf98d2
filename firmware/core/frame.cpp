#include "frame.h"

#include "bytes.h"
#include "crc32.h"

namespace gemelo {

uint32_t Frame::boot_id() const { return load_u32(bytes + 4); }

Frame open_frame(const uint8_t* bytes, size_t size) {
    if (size < kHeaderSize + kCrcSize || bytes[0] != kMagic || bytes[1] != kProtocolVersion) return Frame{};
    const size_t body = size - kCrcSize;
    if (crc32(bytes, body) != load_u32(bytes + body)) return Frame{};
    return Frame{bytes, body};
}

void write_header(uint8_t* bytes, FrameType type, uint8_t joints, uint32_t boot_id) {
    bytes[0] = kMagic;
    bytes[1] = kProtocolVersion;
    bytes[2] = static_cast<uint8_t>(type);
    bytes[3] = joints;
    store_u32(bytes + 4, boot_id);
}

size_t seal_frame(uint8_t* bytes, size_t size) {
    store_u32(bytes + size, crc32(bytes, size));
    return size + kCrcSize;
}

}  // namespace gemelo
