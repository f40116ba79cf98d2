// Why something that was sent is not taken, in words.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "config.h"

namespace gemelo {

// The part it is about, empty for the whole, and a sentence; each is cut off where it would be too long.
struct Refusal {
    static constexpr size_t kReasonSize = 128;
    char part[kNameSize] = "";
    char reason[kReasonSize] = "";
};

// Writes a text with a 0 at its end into a place of fixed size.
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
