#include "refusal.h"

namespace gemelo {

void Phrase::put(char c) {
    if (size_ + 1 >= capacity_) return;
    out_[size_++] = c;
    out_[size_] = 0;
}

Phrase& Phrase::add(const char* text) {
    for (; *text != 0; ++text) put(*text);
    return *this;
}

Phrase& Phrase::add(uint64_t number) {
    char digits[20];
    uint8_t count = 0;
    do {
        digits[count++] = static_cast<char>('0' + number % 10);
        number /= 10;
    } while (number != 0);
    while (count > 0) put(digits[--count]);
    return *this;
}

Phrase& Phrase::add_signed(int64_t number) {
    if (number >= 0) return add(static_cast<uint64_t>(number));
    put('-');
    return add(0 - static_cast<uint64_t>(number));
}

Phrase& Phrase::quote(const char* text) {
    put('"');
    add(text);
    put('"');
    return *this;
}

}  // namespace gemelo
