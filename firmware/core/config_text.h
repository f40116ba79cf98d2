// The JSON of `config` in PROTOCOL.md.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "config.h"
#include "refusal.h"

namespace gemelo {

// The longest text: with a header and a CRC it still is one packet of a serial line.
constexpr size_t kMaxConfigText = 8220;  // follows from kMaxFrame

// True if `text` is a configuration without a fault, which then is in `out`; else why not, and `out` is not to be used.
bool parse_config(const char* text, size_t size, DeviceConfig* out, Refusal* refusal);

}  // namespace gemelo
