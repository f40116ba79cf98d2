// A hobby servo's pin: LEDC makes its pulses by itself, 50 a second, also while the flash is written.
#pragma once

#include <stdint.h>

namespace gemelo {

class ServoPin {
  public:
    // Pulses of the pin before end. kNone: there is no servo.
    void set_up(uint8_t pin);
    // The pulse [us] from the next period on; 0 for none.
    void drive(uint16_t pulse_us);

  private:
    void start(uint32_t duty);

    uint8_t pin_ = 255;
    uint16_t pulse_us_ = 0;
};

}  // namespace gemelo
