// Numbers as decimal text.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

constexpr size_t kDigitsSize = 21;  // follows from the largest number, with the 0 at its end

// The number's text, which ends where `out` does.
const char* digits_of(uint64_t number, char (&out)[kDigitsSize]);

}  // namespace gemelo
