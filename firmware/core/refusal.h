// The reason for a refusal, in words.
#pragma once

#include <stddef.h>

#include "config.h"

namespace gemelo {

// The part it is about, empty for the whole, and a sentence; each is cut off where it would be too long.
struct Refusal {
    static constexpr size_t kReasonSize = 128;  // chosen
    char part[kNameSize] = "";
    char reason[kReasonSize] = "";
};

}  // namespace gemelo
