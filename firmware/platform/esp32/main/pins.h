// The slow pins: set up for a configuration, and driven after each slot. The tick drives STEP and DIR itself.
#pragma once

#include "machine.h"
#include "servo_pin.h"

namespace gemelo {

class SlowPins {
  public:
    // Lets go of the pins of the configuration before; all outputs start switched off, the drivers disabled.
    void set_up(const DeviceConfig& config);
    // The drivers' enable, the outputs and the servo's pulse, where they have changed.
    void drive(const Machine& machine);

  private:
    void let_go();

    const DeviceConfig* config_ = nullptr;
    uint64_t taken_ = 0;  // bit i: GPIO i is set up as an input or an output
    uint16_t outputs_ = 0;
    bool is_enabled_ = false;
    ServoPin servo_;
};

}  // namespace gemelo
