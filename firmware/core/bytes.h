// Little-endian numbers in a byte buffer, whatever the processor's own order and alignment.
#pragma once

#include <stdint.h>

namespace gemelo {

// Calls, but for the short ones: inlined they would be a twentieth of the core.
uint32_t load_u32(const uint8_t* at);
uint64_t load_u64(const uint8_t* at);
void store_u32(uint8_t* at, uint32_t value);
void store_u64(uint8_t* at, uint64_t value);

inline uint16_t load_u16(const uint8_t* at) { return static_cast<uint16_t>(at[0] | (at[1] << 8)); }
inline int32_t load_i32(const uint8_t* at) { return static_cast<int32_t>(load_u32(at)); }

inline void store_u16(uint8_t* at, uint16_t value) {
    at[0] = static_cast<uint8_t>(value);
    at[1] = static_cast<uint8_t>(value >> 8);
}
inline void store_i32(uint8_t* at, int32_t value) { store_u32(at, static_cast<uint32_t>(value)); }

}  // namespace gemelo
