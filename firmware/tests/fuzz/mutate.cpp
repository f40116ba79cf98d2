#include <random>
#include <string>

#include "bytes.h"
#include "frame.h"
#include "play.h"

namespace fuzz {
namespace {

class Mutator {
  public:
    explicit Mutator(uint32_t seed) : random_(seed) {}
    uint32_t below(size_t bound) { return bound == 0 ? 0 : static_cast<uint32_t>(random_() % bound); }
    void change_items(std::vector<Item>& items, const std::vector<Item>& other);
    void change(Item& item);

  private:
    void change_bytes(Bytes& bytes, size_t from);
    void change_frame(Bytes& bytes);
    void change_number(Bytes& bytes);
    void change_text(Bytes& bytes);
    uint32_t interesting();

    std::minstd_rand random_;
};

uint32_t Mutator::interesting() {
    constexpr uint32_t kNumbers[] = {0,          1,     2,          0x7f,       0x80,       0xff,
                                     256,        1000,  250000,     0x7fffffff, 0x80000000, 0xffffffff,
                                     0x12345678, 51200, 0xffff3800, 1000000000, 128,        129};
    return below(3) == 0 ? static_cast<uint32_t>(random_()) : kNumbers[below(sizeof kNumbers / sizeof kNumbers[0])];
}

void Mutator::change_bytes(Bytes& bytes, size_t from) {
    if (bytes.size() <= from) return bytes.push_back(static_cast<uint8_t>(random_()));
    const size_t at = from + below(bytes.size() - from);
    switch (below(7)) {
        case 0:
            bytes[at] = static_cast<uint8_t>(bytes[at] ^ (1u << below(8)));
            break;
        case 1:
            bytes[at] = static_cast<uint8_t>(random_());
            break;
        case 2:
            bytes.insert(bytes.begin() + static_cast<long>(at), static_cast<uint8_t>(random_()));
            break;
        case 3:
            bytes.erase(bytes.begin() + static_cast<long>(at));
            break;
        case 4:
            bytes.resize(at);
            break;
        case 5:
            bytes[at] = static_cast<uint8_t>(bytes[at] + below(35) - 17);
            break;
        default: {
            const size_t length = below(bytes.size() - at);
            const Bytes piece(bytes.begin() + static_cast<long>(at), bytes.begin() + static_cast<long>(at + length));
            if (bytes.size() < 2000) bytes.insert(bytes.begin() + static_cast<long>(at), piece.begin(), piece.end());
        }
    }
}

// Behind the type as a rule, and with the right CRC as a rule.
void Mutator::change_frame(Bytes& bytes) {
    if (bytes.size() < gemelo::kHeaderSize + gemelo::kCrcSize || below(40) == 0) return change_bytes(bytes, 0);
    bytes.resize(bytes.size() - gemelo::kCrcSize);
    if (below(3) != 0 && bytes.size() >= 12) {
        const size_t at = 8 + below((bytes.size() - 8) / 4) * 4;
        if (at + 4 <= bytes.size()) gemelo::store_u32(&bytes[at], interesting());
    } else {
        change_bytes(bytes, below(8) == 0 ? 2 : 8);
    }
    const size_t size = bytes.size();
    bytes.resize(size + gemelo::kCrcSize);
    if (size >= gemelo::kHeaderSize) gemelo::seal_frame(bytes.data(), size);
    if (below(50) == 0) bytes.back() = static_cast<uint8_t>(bytes.back() ^ 1);
}

// The number that begins at or after some place becomes another one.
void Mutator::change_number(Bytes& bytes) {
    const auto is_digit = [](uint8_t c) { return c >= '0' && c <= '9'; };
    size_t at = below(bytes.size());
    while (at < bytes.size() && !is_digit(bytes[at])) ++at;
    size_t end = at;
    while (end < bytes.size() && is_digit(bytes[end])) ++end;
    if (at == end) return;
    std::string number = std::to_string(interesting());
    if (below(6) == 0) number = "-" + number;
    if (below(12) == 0) number += ".5";
    if (below(12) == 0) number += std::to_string(random_());
    bytes.erase(bytes.begin() + static_cast<long>(at), bytes.begin() + static_cast<long>(end));
    bytes.insert(bytes.begin() + static_cast<long>(at), number.begin(), number.end());
}

void Mutator::change_text(Bytes& bytes) {
    constexpr const char* kWords[] = {
        "\"",      "{",       "}",   "[",           "]", ",", ":", "null", "true", "false",       "nan",      "1e9",
        "\\u0000", "\\ud83d", "\\n", "\"homing\":", "<", ">", "-", ".",    "\xff", "\"joints\":", "\"home\"", "255"};
    if (below(2) == 0) return change_number(bytes);
    if (below(3) != 0) return change_bytes(bytes, 0);
    const std::string word = kWords[below(sizeof kWords / sizeof kWords[0])];
    bytes.insert(bytes.begin() + static_cast<long>(below(bytes.size() + 1)), word.begin(), word.end());
}

void Mutator::change(Item& item) {
    switch (item.kind) {
        case Kind::Frame:
        case Kind::Retained:
        case Kind::Packet:
            return change_frame(item.bytes);
        case Kind::Line:
        case Kind::Config:
        case Kind::Provision:
        case Kind::Json:
            return change_text(item.bytes);
        default:
            return change_bytes(item.bytes, 0);
    }
}

void Mutator::change_items(std::vector<Item>& items, const std::vector<Item>& other) {
    if (items.empty()) items = other;
    if (items.empty()) return;
    const size_t at = below(items.size());
    switch (below(12)) {
        case 0:
            items.erase(items.begin() + static_cast<long>(at));
            break;
        case 1:
            items.insert(items.begin() + static_cast<long>(at), items[below(items.size())]);
            break;
        case 2:
            if (!other.empty()) items.insert(items.begin() + static_cast<long>(at), other[below(other.size())]);
            break;
        case 3:
            std::swap(items[at], items[below(items.size())]);
            break;
        case 4:
            items.insert(items.begin() + static_cast<long>(at),
                         Item{below(4) == 0 ? Kind::Levels : Kind::Slots, {static_cast<uint8_t>(random_())}});
            break;
        case 5:
            // The same frame by another way.
            if (items[at].kind <= Kind::Packet) items[at].kind = static_cast<Kind>(below(3));
            break;
        default:
            change(items[at]);
    }
}

}  // namespace

void mutate(std::vector<Item>& items, const std::vector<Item>& other, uint32_t seed) {
    Mutator mutator(seed);
    for (uint32_t i = 1 + mutator.below(4); i > 0; --i) mutator.change_items(items, other);
    if (items.size() > 64) items.resize(64);
}

}  // namespace fuzz
