// The meaning of a fuzzer's input: items, each a kind, a length of 16 bits and so many bytes.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <vector>

namespace fuzz {

using Bytes = std::vector<uint8_t>;

enum class Kind : uint8_t {
    Frame,     // over MQTT
    Retained,  // the same, retained
    Packet,    // a frame over the serial line, in COBS
    Serial,    // bytes on the serial line as they are
    Line,      // of text, its end is added
    Config,    // JSON over MQTT
    Provision,
    Json,     // any JSON, to the reader alone
    Slots,    // so many milliseconds pass: the first byte
    Levels,   // of the inputs: the first byte
    Silence,  // 20 times so many milliseconds
    Count,
};

struct Item {
    Kind kind;
    Bytes bytes;
};

std::vector<Item> read_items(const uint8_t* data, size_t size);
Bytes write_items(const std::vector<Item>& items);

// Chunks that a device has taken.
struct Taken {
    uint64_t chunks = 0, replacements = 0;
};

// Plays them to a device and ends the process where it breaks a promise.
Taken play(const std::vector<Item>& items);

// Good starts.
std::vector<std::vector<Item>> seeds();

// One change, or some, that keeps what a parser needs to get further: CRCs, brackets, the beginnings of frames.
void mutate(std::vector<Item>& items, const std::vector<Item>& other, uint32_t seed);

}  // namespace fuzz
