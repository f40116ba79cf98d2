// A short text that is put together, for the detail of an event.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

// What does not fit is cut off.
class Sentence {
  public:
    Sentence& add(const char* text) {
        for (; *text != 0; ++text) put(*text);
        return *this;
    }
    Sentence& add(uint32_t number) {
        char digits[10];
        uint8_t count = 0;
        do {
            digits[count++] = static_cast<char>('0' + number % 10);
            number /= 10;
        } while (number != 0);
        while (count > 0) put(digits[--count]);
        return *this;
    }
    Sentence& add(int32_t number) {
        if (number < 0) put('-');
        return add(number < 0 ? 0u - static_cast<uint32_t>(number) : static_cast<uint32_t>(number));
    }
    const char* text() const { return text_; }

  private:
    void put(char c) {
        if (size_ + 1 < sizeof text_) text_[size_++] = c;
    }

    char text_[80] = {};
    size_t size_ = 0;
};

}  // namespace gemelo
