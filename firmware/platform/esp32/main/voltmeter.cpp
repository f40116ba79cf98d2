#include "voltmeter.h"

#include "esp_adc/adc_cali_scheme.h"
#include "esp_err.h"

namespace gemelo {
namespace {

constexpr adc_atten_t kAttenuation = ADC_ATTEN_DB_12;  // up to some 3.1 V
constexpr int kReadings = 8;                           // of one measurement, averaged: the ADC is noisy

}  // namespace

void Voltmeter::begin() {
    adc_oneshot_unit_init_cfg_t config = {};
    config.unit_id = ADC_UNIT_1;
    ESP_ERROR_CHECK(adc_oneshot_new_unit(&config, &unit_));
}

bool Voltmeter::measure(uint8_t pin, int32_t* millivolts) {
    adc_channel_t channel;
    if (!set_up(pin, &channel)) return false;
    int32_t sum = 0;
    for (int i = 0; i < kReadings; ++i) {
        int raw = 0, voltage = 0;
        if (adc_oneshot_read(unit_, channel, &raw) != ESP_OK) return false;
        if (adc_cali_raw_to_voltage(calibration_[channel], raw, &voltage) != ESP_OK) return false;
        sum += voltage;
    }
    *millivolts = sum / kReadings;
    return true;
}

// Each time anew: a configuration may have used the pin for something else since the last measurement.
bool Voltmeter::set_up(uint8_t pin, adc_channel_t* channel) {
    adc_unit_t unit;
    if (adc_oneshot_io_to_channel(pin, &unit, channel) != ESP_OK || unit != ADC_UNIT_1) return false;
    if (*channel >= kChannels) return false;
    adc_oneshot_chan_cfg_t config = {};
    config.atten = kAttenuation;
    config.bitwidth = ADC_BITWIDTH_DEFAULT;
    if (adc_oneshot_config_channel(unit_, *channel, &config) != ESP_OK) return false;
    return calibration_[*channel] != nullptr || calibrate(*channel, &calibration_[*channel]);
}

bool Voltmeter::calibrate([[maybe_unused]] adc_channel_t channel, adc_cali_handle_t* calibration) {
#if ADC_CALI_SCHEME_CURVE_FITTING_SUPPORTED
    adc_cali_curve_fitting_config_t config = {};
    config.unit_id = ADC_UNIT_1;
    config.chan = channel;
    config.atten = kAttenuation;
    config.bitwidth = ADC_BITWIDTH_DEFAULT;
    return adc_cali_create_scheme_curve_fitting(&config, calibration) == ESP_OK;
#else
    adc_cali_line_fitting_config_t config = {};
    config.unit_id = ADC_UNIT_1;
    config.atten = kAttenuation;
    config.bitwidth = ADC_BITWIDTH_DEFAULT;
    config.default_vref = 1100;  // [mV] the ESP32's nominal one, for chips without a burnt one
    return adc_cali_create_scheme_line_fitting(&config, calibration) == ESP_OK;
#endif
}

}  // namespace gemelo
