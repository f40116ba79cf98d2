#include "crc32.h"

namespace gemelo {
namespace {

struct Table {
    uint32_t entry[256];
};

constexpr Table make_table() {
    Table table{};
    for (uint32_t i = 0; i < 256; ++i) {
        uint32_t value = i;
        for (int bit = 0; bit < 8; ++bit) value = (value & 1) ? (value >> 1) ^ 0xEDB88320u : value >> 1;
        table.entry[i] = value;
    }
    return table;
}

constexpr Table kTable = make_table();

}  // namespace

uint32_t crc32(const uint8_t* bytes, size_t size, uint32_t before) {
    uint32_t value = ~before;
    for (size_t i = 0; i < size; ++i) value = kTable.entry[(value ^ bytes[i]) & 0xFF] ^ (value >> 8);
    return ~value;
}

}  // namespace gemelo
