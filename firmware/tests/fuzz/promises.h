// Properties that must hold whatever is sent.
#pragma once

#include <stdio.h>
#include <stdlib.h>

#include "play.h"
#include "report.h"

namespace fuzz {

[[noreturn]] inline void broken(const char* promise, int line) {
    fprintf(stderr, "broken promise (line %d): %s\n", line, promise);
    abort();
}

#define PROMISE(condition) \
    if (!(condition)) fuzz::broken(#condition, __LINE__)

// An output is what PROTOCOL.md says: a frame with its CRC and length, JSON, or a line of text.
void check_output(gemelo::Output output, const uint8_t* bytes, size_t size, uint8_t joints);

// An answer that refuses.
bool is_refusal(gemelo::Output output, const uint8_t* bytes, size_t size);

}  // namespace fuzz
