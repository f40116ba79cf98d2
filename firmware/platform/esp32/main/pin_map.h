// Tables from the stepper's joints to the bits of the GPIO registers, so that the tick only looks up.
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

// Bits of GPIO 0 to 31 and 32 to 63.
struct Banks {
    uint32_t low = 0;
    uint32_t high = 0;
};

class PinTable {
  public:
    // `pin_of_joint` has kNone for a joint without a pin.
    void begin(const uint8_t* pin_of_joint) {
        for (uint32_t joints = 0; joints < kSize; ++joints) banks_[joints] = sum(pin_of_joint, joints);
    }
    // The pins of all joints whose bit is set.
    __attribute__((always_inline)) const Banks& operator[](uint32_t joints) const {
        return banks_[joints & (kSize - 1)];
    }

  private:
    static Banks sum(const uint8_t* pin_of_joint, uint32_t joints) {
        Banks banks;
        for (uint8_t j = 0; j < kMaxJoints; ++j) {
            const uint8_t pin = pin_of_joint[j];
            if ((joints >> j & 1) == 0 || pin > kMaxPin) continue;
            (pin < 32 ? banks.low : banks.high) |= 1u << (pin % 32);
        }
        return banks;
    }

    static constexpr uint32_t kSize = 1u << kMaxJoints;
    Banks banks_[kSize];
};

}  // namespace gemelo
