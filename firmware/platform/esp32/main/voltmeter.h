// ADC1 in mV, calibrated with what the factory has burnt into the chip.
#pragma once

#include <stdint.h>

#include "esp_adc/adc_cali.h"
#include "esp_adc/adc_oneshot.h"

namespace gemelo {

class Voltmeter {
  public:
    void begin();
    // False where the pin cannot be measured, or the chip has no calibration.
    bool measure(uint8_t pin, int32_t* millivolts);

  private:
    bool set_up(uint8_t pin, adc_channel_t* channel);
    bool calibrate(adc_channel_t channel, adc_cali_handle_t* calibration);

    static constexpr uint8_t kChannels = 10;
    adc_oneshot_unit_handle_t unit_ = nullptr;
    adc_cali_handle_t calibration_[kChannels] = {};
};

}  // namespace gemelo
