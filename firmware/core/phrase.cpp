#include "phrase.h"

#include "digits.h"

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
    char digits[kDigitsSize];
    return add(digits_of(number, digits));
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
