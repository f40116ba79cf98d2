// Text out, one character at a time: to the UART of QEMU's machine, or to the host's standard output.
#pragma once

#include <stddef.h>
#include <stdint.h>

void put(char c);

inline void put_text(const char* text) {
    while (*text != '\0') put(*text++);
}

inline void put_bytes(const uint8_t* bytes, size_t size) {
    for (size_t i = 0; i < size; ++i) put(static_cast<char>(bytes[i]));
}

inline void put_number(int64_t value) {
    char digits[20];
    size_t size = 0;
    uint64_t rest = value < 0 ? 0 - static_cast<uint64_t>(value) : static_cast<uint64_t>(value);
    do digits[size++] = static_cast<char>('0' + rest % 10);
    while ((rest /= 10) != 0);
    if (value < 0) put('-');
    while (size-- != 0) put(digits[size]);
}
