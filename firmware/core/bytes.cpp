#include "bytes.h"

namespace gemelo {

uint32_t load_u32(const uint8_t* at) {
    return static_cast<uint32_t>(load_u16(at)) | (static_cast<uint32_t>(load_u16(at + 2)) << 16);
}

uint64_t load_u64(const uint8_t* at) {
    return static_cast<uint64_t>(load_u32(at)) | (static_cast<uint64_t>(load_u32(at + 4)) << 32);
}

void store_u32(uint8_t* at, uint32_t value) {
    store_u16(at, static_cast<uint16_t>(value));
    store_u16(at + 2, static_cast<uint16_t>(value >> 16));
}

void store_u64(uint8_t* at, uint64_t value) {
    store_u32(at, static_cast<uint32_t>(value));
    store_u32(at + 4, static_cast<uint32_t>(value >> 32));
}

}  // namespace gemelo
