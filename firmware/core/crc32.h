// CRC-32 as in IEEE 802.3 and zlib.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

// `before` is the CRC of what precedes these bytes.
uint32_t crc32(const uint8_t* bytes, size_t size, uint32_t before = 0);

}  // namespace gemelo
