// The states of the input pins, tick by tick: which inputs are active, and when that changes.
//
// Active is what three equal readings in successive ticks say, and of an e-stop what a single one says.
#pragma once

#include <stdint.h>

#include "config.h"

namespace gemelo {

// Levels of GPIO 0 to 31 and 32 to 63, as the pins have them.
struct Levels {
    uint32_t low = 0;
    uint32_t high = 0;
};

class InputWatch {
  public:
    // No input is active, until the pins say otherwise.
    void begin(const DeviceConfig& config);
    // Sees nothing until begin().
    void blind() { mask_ = Levels{}; }

    // True if a pin differs from the active inputs; otherwise there is nothing to read.
    bool differs(const Levels& levels) const {
        return (((levels.low ^ expected_.low) & mask_.low) | ((levels.high ^ expected_.high) & mask_.high)) != 0;
    }
    // Takes the readings of a tick, of which there are 2^32; bit i of the result: input i has become active.
    uint32_t read(const Levels& levels, uint32_t tick);

    uint32_t active() const { return active_; }
    uint32_t estops() const { return estops_; }  // bit i: input i is an e-stop

  private:
    uint32_t active_in(const Levels& levels) const;
    void expect(const Levels& levels, uint32_t changed);

    struct Pin {
        uint8_t number;
        uint8_t is_inverted;
    };

    Levels mask_;
    Levels expected_;
    uint32_t active_ = 0;
    uint32_t estops_ = 0;
    uint32_t once_ = 0;   // inputs whose last reading, and
    uint32_t twice_ = 0;  // whose last two readings are not what they are taken for
    uint32_t last_tick_ = 0;
    uint8_t inputs_ = 0;
    Pin pin_[kMaxInputs];
};

}  // namespace gemelo
