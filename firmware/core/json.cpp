#include "json.h"

#include "digits.h"

namespace gemelo {

void JsonWriter::put(char c) {
    if (size_ < kSize) text_[size_++] = c;
}

void JsonWriter::put(const char* text) {
    for (; *text != 0; ++text) put(*text);
}

// A control character becomes a question mark: none belongs into what is said.
void JsonWriter::put_escaped(char c) {
    if (c == '"' || c == '\\') put('\\');
    put(static_cast<uint8_t>(c) < 0x20 ? '?' : c);
}

void JsonWriter::put_number(uint64_t number) {
    char digits[kDigitsSize];
    put(digits_of(number, digits));
}

void JsonWriter::key(const char* name) {
    put(size_ > 1 ? ", \"" : "\"");
    put(name);
    put("\": ");
}

void JsonWriter::field(const char* name, const char* text) {
    key(name);
    put('"');
    for (; *text != 0; ++text) put_escaped(*text);
    put('"');
}

void JsonWriter::field(const char* name, uint64_t number) {
    key(name);
    put_number(number);
}

void JsonWriter::field(const char* name, bool truth) {
    key(name);
    put(truth ? "true" : "false");
}

void JsonWriter::field_milli(const char* name, int32_t milli) {
    key(name);
    if (milli < 0) put('-');
    const uint32_t size = milli < 0 ? 0 - static_cast<uint32_t>(milli) : static_cast<uint32_t>(milli);
    put_number(size / 1000);
    put('.');
    put(static_cast<char>('0' + size / 100 % 10));
    put(static_cast<char>('0' + size / 10 % 10));
    put(static_cast<char>('0' + size % 10));
}

void JsonWriter::field(const char* name, uint32_t first, uint32_t second) {
    key(name);
    put('[');
    put_number(first);
    put(", ");
    put_number(second);
    put(']');
}

size_t JsonWriter::close() {
    put('}');
    return size_;
}

}  // namespace gemelo
