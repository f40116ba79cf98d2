// The boot button as a factory reset: pressed soon after the start and held.
#pragma once

#include <stdint.h>

namespace gemelo {

class FactoryButton {
  public:
    // True once, when it has been held for 5 s since a press within the first 10 s after the start.
    bool is_held(bool is_pressed, uint64_t now_us) {
        if (!is_pressed) is_down_ = false;
        if (is_pressed && !is_down_ && now_us < kWindowUs) {
            is_down_ = true;
            since_us_ = now_us;
        }
        if (!is_down_ || is_done_ || now_us < since_us_ + kHoldUs) return false;
        return is_done_ = true;
    }

  private:
    static constexpr uint64_t kWindowUs = 10000000;
    static constexpr uint64_t kHoldUs = 5000000;
    uint64_t since_us_ = 0;
    bool is_down_ = false;
    bool is_done_ = false;
};

}  // namespace gemelo
