#include "digits.h"

namespace gemelo {

// In 32 bits as soon as they do: the chip has no division of 64.
const char* digits_of(uint64_t number, char (&out)[kDigitsSize]) {
    char* first = out + kDigitsSize - 1;
    *first = 0;
    for (; number > UINT32_MAX; number /= 10) *--first = static_cast<char>('0' + number % 10);
    uint32_t rest = static_cast<uint32_t>(number);
    do {
        *--first = static_cast<char>('0' + rest % 10);
        rest /= 10;
    } while (rest != 0);
    return first;
}

}  // namespace gemelo
