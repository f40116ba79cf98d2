#include "play.h"

namespace fuzz {

std::vector<Item> read_items(const uint8_t* data, size_t size) {
    std::vector<Item> items;
    size_t at = 0;
    while (at + 3 <= size && items.size() < 64) {
        const Kind kind = static_cast<Kind>(data[at] % static_cast<uint8_t>(Kind::Count));
        const size_t wanted = static_cast<size_t>(data[at + 1]) | static_cast<size_t>(data[at + 2]) << 8;
        at += 3;
        const size_t length = wanted < size - at ? wanted : size - at;
        items.push_back({kind, Bytes(data + at, data + at + length)});
        at += length;
    }
    return items;
}

Bytes write_items(const std::vector<Item>& items) {
    Bytes bytes;
    for (const Item& item : items) {
        bytes.push_back(static_cast<uint8_t>(item.kind));
        bytes.push_back(static_cast<uint8_t>(item.bytes.size()));
        bytes.push_back(static_cast<uint8_t>(item.bytes.size() >> 8));
        bytes.insert(bytes.end(), item.bytes.begin(), item.bytes.end());
    }
    return bytes;
}

}  // namespace fuzz
