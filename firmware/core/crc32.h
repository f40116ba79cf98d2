// CRC-32 as in IEEE 802.3 and zlib.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

uint32_t crc32(const uint8_t* bytes, size_t size);

}  // namespace gemelo
