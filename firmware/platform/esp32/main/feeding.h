// The moments at which a task feeds its watchdog: by the time that has passed, however long its turns take.
#pragma once

#include <stdint.h>

namespace gemelo {

class Feeding {
  public:
    static constexpr uint64_t kPeriodUs = 100000;  // chosen: a fiftieth of the watchdog's patience
    // True at once, and then with the first turn that ends a period after the last feeding.
    bool is_due(uint64_t now_us) {
        if (has_fed_ && now_us - fed_us_ < kPeriodUs) return false;
        has_fed_ = true;
        fed_us_ = now_us;
        return true;
    }

  private:
    bool has_fed_ = false;
    uint64_t fed_us_ = 0;
};

}  // namespace gemelo
