#include "servo_pin.h"

#include "config.h"
#include "driver/ledc.h"
#include "esp_err.h"

namespace gemelo {
namespace {

constexpr uint32_t kPeriodUs = 20000;
constexpr ledc_mode_t kMode = LEDC_LOW_SPEED_MODE;           // the only one that every chip has
constexpr ledc_timer_bit_t kResolution = LEDC_TIMER_14_BIT;  // the most that every chip has: 1.2 us
constexpr ledc_timer_t kTimer = LEDC_TIMER_0;
constexpr ledc_channel_t kChannel = LEDC_CHANNEL_0;

uint32_t duty_of(uint16_t pulse_us) { return ((pulse_us << kResolution) + kPeriodUs / 2) / kPeriodUs; }

}  // namespace

void ServoPin::set_up(uint8_t pin) {
    drive(0);
    pin_ = pin;
}

void ServoPin::drive(uint16_t pulse_us) {
    if (pin_ == kNone || pulse_us == pulse_us_) return;
    const bool is_running = pulse_us_ != 0;
    pulse_us_ = pulse_us;
    if (!is_running) return start(duty_of(pulse_us));
    // Also to none: that takes effect at the end of a period, where ledc_stop() would cut the pulse that is under way.
    ESP_ERROR_CHECK(ledc_set_duty(kMode, kChannel, duty_of(pulse_us)));
    ESP_ERROR_CHECK(ledc_update_duty(kMode, kChannel));
}

void ServoPin::start(uint32_t duty) {
    ledc_timer_config_t timer = {};
    timer.speed_mode = kMode;
    timer.duty_resolution = kResolution;
    timer.timer_num = kTimer;
    timer.freq_hz = 1000000 / kPeriodUs;
    timer.clk_cfg = LEDC_AUTO_CLK;
    ESP_ERROR_CHECK(ledc_timer_config(&timer));
    ledc_channel_config_t channel = {};
    channel.gpio_num = pin_;
    channel.speed_mode = kMode;
    channel.channel = kChannel;
    channel.timer_sel = kTimer;
    channel.duty = duty;
    ESP_ERROR_CHECK(ledc_channel_config(&channel));
}

}  // namespace gemelo
