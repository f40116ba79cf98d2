// A line of text mode: `<SEQ,J1,...,Jn>`.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "config.h"
#include "protocol.h"

namespace gemelo {

constexpr size_t kMaxTextLine = 255;  // bytes, without the end of the line; standard: PROTOCOL.md

struct TextLine {
    bool is_line = false;  // false: cut off, or two lines in one; nothing else is set then
    uint32_t seq = 0;      // 0 where it cannot be read
    Code code = Code::Ok;  // why it cannot be followed
    int32_t target_q8[kMaxJoints] = {};
};

// `line` is without its end.
TextLine read_text_line(const char* line, size_t size, const DeviceConfig& config);

}  // namespace gemelo
