#include "json_reader.h"

namespace gemelo {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool is_surrogate(uint32_t code) { return code >= 0xd800 && code < 0xe000; }

// UTF-8 of `code` (RFC 3629); returns how many bytes.
size_t encode(uint32_t code, char* out) {
    if (code < 0x80) {
        out[0] = static_cast<char>(code);
        return 1;
    }
    const size_t size = code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
    constexpr uint8_t kLeads[] = {0, 0, 0xc0, 0xe0, 0xf0};
    for (size_t i = size - 1; i > 0; --i, code >>= 6) out[i] = static_cast<char>(0x80 | (code & 0x3f));
    out[0] = static_cast<char>(kLeads[size] | code);
    return size;
}

}  // namespace

bool JsonInteger::is_within(int64_t lowest, uint64_t highest) const {
    if (!is_negative || magnitude == 0)
        return magnitude <= highest && (lowest <= 0 || magnitude >= static_cast<uint64_t>(lowest));
    return lowest < 0 && magnitude <= 0 - static_cast<uint64_t>(lowest);
}

bool JsonReader::fail(const char* error) {
    if (error_ == nullptr) error_ = error;
    return false;
}

void JsonReader::skip_space() {
    while (at_ != end_ && (*at_ == ' ' || *at_ == '\t' || *at_ == '\n' || *at_ == '\r')) ++at_;
}

bool JsonReader::open(char bracket) {
    skip_space();
    if (error_ != nullptr) return false;
    if (at_ == end_ || *at_ != bracket) return fail(bracket == '{' ? "an object is expected" : "a list is expected");
    ++at_;
    is_first_ = true;
    return true;
}

bool JsonReader::next(char closing_bracket) {
    skip_space();
    if (error_ != nullptr) return false;
    if (at_ == end_) return fail("the text ends too early");
    const bool was_first = is_first_;
    is_first_ = false;
    if (*at_ == closing_bracket) {
        ++at_;
        return false;
    }
    if (was_first) return true;
    if (*at_ != ',') return fail("a comma or a closing bracket is expected");
    ++at_;
    return true;
}

bool JsonReader::key(char* out, size_t capacity) {
    if (!text(out, capacity)) return false;
    skip_space();
    if (at_ == end_ || *at_ != ':') return fail("a colon is expected");
    ++at_;
    return true;
}

bool JsonReader::text(char* out, size_t capacity) {
    skip_space();
    if (error_ != nullptr) return false;
    if (at_ == end_ || *at_ != '"') return fail("a text in quotes is expected");
    ++at_;
    size_t size = 0;
    while (at_ != end_ && *at_ != '"') {
        uint32_t code = 0;
        char bytes[4];
        if (!code_point(&code)) return false;
        const size_t count = encode(code, bytes);
        if (size + count >= capacity) {
            is_too_long_ = true;
            return fail("the text is too long");
        }
        for (size_t i = 0; i < count; ++i) out[size + i] = bytes[i];
        size += count;
    }
    if (at_ == end_) return fail("a text has no end");
    ++at_;
    out[size] = 0;
    return true;
}

bool JsonReader::code_point(uint32_t* out) {
    const uint8_t first = static_cast<uint8_t>(*at_);
    if (first < 0x20) return fail("a control character stands in a text");
    if (first != '\\') return utf8(out);
    ++at_;
    if (!escape(out)) return false;
    return *out != 0 || fail("a zero stands in a text");
}

// What follows a backslash.
bool JsonReader::escape(uint32_t* out) {
    if (at_ == end_) return fail("a text has no end");
    const char c = *at_++;
    if (c == 'u') {
        if (!hex(out)) return false;
        if (!is_surrogate(*out)) return true;
        uint32_t low = 0;
        const bool is_pair = *out < 0xdc00 && end_ - at_ >= 2 && at_[0] == '\\' && at_[1] == 'u';
        if (!is_pair) return fail("half of a surrogate pair stands in a text");
        at_ += 2;
        if (!hex(&low)) return false;
        if (low < 0xdc00 || low >= 0xe000) return fail("half of a surrogate pair stands in a text");
        *out = 0x10000 + ((*out - 0xd800) << 10) + (low - 0xdc00);
        return true;
    }
    constexpr char kNames[] = "\"\\/bfnrt";
    constexpr char kValues[] = "\"\\/\b\f\n\r\t";
    for (uint8_t i = 0; kNames[i] != 0; ++i) {
        if (kNames[i] != c) continue;
        *out = static_cast<uint8_t>(kValues[i]);
        return true;
    }
    return fail("an unknown escape stands in a text");
}

bool JsonReader::hex(uint32_t* out) {
    *out = 0;
    for (uint8_t i = 0; i < 4; ++i, ++at_) {
        if (at_ == end_) return fail("a text has no end");
        const char c = *at_;
        const char lower = static_cast<char>(c | 0x20);
        if (!is_digit(c) && (lower < 'a' || lower > 'f')) return fail("an escape has four hexadecimal digits");
        *out = (*out << 4) | static_cast<uint32_t>(is_digit(c) ? c - '0' : lower - 'a' + 10);
    }
    return true;
}

bool JsonReader::utf8(uint32_t* out) {
    constexpr const char* kError = "a text is not UTF-8";
    const uint8_t first = static_cast<uint8_t>(*at_++);
    *out = first;
    if (first < 0x80) return true;
    const uint8_t more = first < 0xc0 ? 0 : first < 0xe0 ? 1 : first < 0xf0 ? 2 : first < 0xf8 ? 3 : 0;
    if (more == 0) return fail(kError);
    *out = first & (0x3fu >> more);
    for (uint8_t i = 0; i < more; ++i, ++at_) {
        if (at_ == end_ || (static_cast<uint8_t>(*at_) & 0xc0) != 0x80) return fail(kError);
        *out = (*out << 6) | (static_cast<uint8_t>(*at_) & 0x3f);
    }
    constexpr uint32_t kLeast[] = {0, 0x80, 0x800, 0x10000};
    if (*out < kLeast[more] || *out > 0x10ffff || is_surrogate(*out)) return fail(kError);
    return true;
}

bool JsonReader::integer(JsonInteger* out) {
    constexpr const char* kError = "an integer is expected";
    skip_space();
    if (error_ != nullptr) return false;
    *out = JsonInteger{};
    if (at_ != end_ && *at_ == '-') {
        out->is_negative = true;
        ++at_;
    }
    if (at_ == end_ || !is_digit(*at_)) return fail(kError);
    const char* first = at_;
    for (; at_ != end_ && is_digit(*at_); ++at_) {
        const uint64_t digit = static_cast<uint64_t>(*at_ - '0');
        constexpr uint64_t kTenth = UINT64_MAX / 10;
        if (out->magnitude > kTenth || (out->magnitude == kTenth && digit > UINT64_MAX % 10))
            return fail("the number is too large");
        if (at_ != first && *first == '0') return fail("a number begins with a zero");
        out->magnitude = out->magnitude * 10 + digit;
    }
    if (at_ != end_ && (*at_ == '.' || *at_ == 'e' || *at_ == 'E')) return fail(kError);
    return true;
}

bool JsonReader::eat(const char* word) {
    const char* at = at_;
    for (; *word != 0; ++word, ++at)
        if (at == end_ || *at != *word) return false;
    at_ = at;
    return true;
}

bool JsonReader::truth(bool* out) {
    skip_space();
    if (error_ != nullptr) return false;
    *out = eat("true");
    return *out || eat("false") || fail("true or false is expected");
}

bool JsonReader::null() {
    skip_space();
    return error_ == nullptr && eat("null");
}

bool JsonReader::end() {
    skip_space();
    return at_ == end_ || fail("something follows the end");
}

}  // namespace gemelo
