// The cause of the chip's last reset.
#pragma once

namespace gemelo {

struct ResetCause {
    const char* text;
    bool is_warm;  // it was not without power and its supply did not fail: memory of before can be believed
};

ResetCause reset_cause();

}  // namespace gemelo
