// The time of the next attempt: soon at first, then ever more seldom.
#pragma once

#include <stdint.h>

namespace gemelo {

class BackOff {
  public:
    // Something has failed: the next attempt is due after a pause that doubles, 0.5 s to 16 s.
    void fail(uint64_t now_us) {
        due_us_ = now_us + pause_us_;
        pause_us_ = pause_us_ < kLongestUs / 2 ? pause_us_ * 2 : kLongestUs;
        is_waiting_ = true;
    }
    void succeed() {
        pause_us_ = kShortestUs;
        is_waiting_ = false;
    }
    // True once for every fail().
    bool is_due(uint64_t now_us) {
        if (!is_waiting_ || now_us < due_us_) return false;
        is_waiting_ = false;
        return true;
    }

  private:
    static constexpr uint64_t kShortestUs = 500000;
    static constexpr uint64_t kLongestUs = 16000000;
    uint64_t pause_us_ = kShortestUs;
    uint64_t due_us_ = 0;
    bool is_waiting_ = false;
};

}  // namespace gemelo
