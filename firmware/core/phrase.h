// A short text that is put together.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

// Writes a text with a 0 at its end into a place of fixed size; what does not fit is cut off.
class Phrase {
  public:
    Phrase(char* out, size_t capacity) : out_(out), capacity_(capacity) { out_[0] = 0; }
    Phrase& add(const char* text);
    Phrase& add(uint64_t number);
    Phrase& add_signed(int64_t number);
    // In quotes.
    Phrase& quote(const char* text);
    size_t size() const { return size_; }

  private:
    void put(char c);

    char* out_;
    size_t capacity_;
    size_t size_ = 0;
};

}  // namespace gemelo
