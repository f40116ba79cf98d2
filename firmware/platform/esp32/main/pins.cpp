#include "pins.h"

#include "chip.h"
#include "driver/gpio.h"
#include "esp_err.h"
#include "pin_uses.h"

namespace gemelo {
namespace {

gpio_num_t number(uint8_t pin) { return static_cast<gpio_num_t>(pin); }

void put(uint8_t pin, bool is_on, bool is_inverted) {
    if (pin != kNone) ESP_ERROR_CHECK(gpio_set_level(number(pin), is_on != is_inverted ? 1 : 0));
}

void configure(uint8_t pin_number, gpio_mode_t mode, Pull pull) {
    gpio_config_t config = {};
    config.pin_bit_mask = pin(pin_number);
    config.mode = mode;
    config.pull_up_en = pull == Pull::Up ? GPIO_PULLUP_ENABLE : GPIO_PULLUP_DISABLE;
    config.pull_down_en = pull == Pull::Down ? GPIO_PULLDOWN_ENABLE : GPIO_PULLDOWN_DISABLE;
    config.intr_type = GPIO_INTR_DISABLE;
    ESP_ERROR_CHECK(gpio_config(&config));
}

}  // namespace

// The level stands before the pin becomes an output, so it never says anything else.
void SlowPins::set_up(const DeviceConfig& config) {
    servo_.set_up(config.servo.pin);
    let_go();
    config_ = &config;
    outputs_ = 0;
    is_enabled_ = false;
    const PinUses uses(config);
    for (const PinUse& use : uses)
        if (use.use == Use::Output) put(use.pin, false, false);
    put(config.enable_pin, false, config.is_enable_inverted != 0);
    for (uint8_t i = 0; i < config.outputs; ++i) put(config.output[i].pin, false, config.output[i].is_inverted != 0);
    for (const PinUse& use : uses) {
        // Let go, an analog pin would get a pull-up: it is the ADC's, which sets it up for each measurement.
        if (use.use != Use::Analog) taken_ |= pin(use.pin);
        if (use.use == Use::Output) configure(use.pin, GPIO_MODE_OUTPUT, Pull::None);
        if (use.use == Use::Input) configure(use.pin, GPIO_MODE_INPUT, use.pull);
    }
}

void SlowPins::let_go() {
    for (uint8_t i = 0; i <= kMaxPin; ++i)
        if ((taken_ & pin(i)) != 0) ESP_ERROR_CHECK(gpio_reset_pin(number(i)));
    taken_ = 0;
}

void SlowPins::drive(const Machine& machine) {
    if (config_ == nullptr) return;
    if (machine.is_enabled() != is_enabled_) {
        is_enabled_ = !is_enabled_;
        put(config_->enable_pin, is_enabled_, config_->is_enable_inverted != 0);
    }
    servo_.drive(machine.servo().pulse_us());
    const uint16_t changed = machine.outputs() ^ outputs_;
    outputs_ = machine.outputs();
    for (uint8_t i = 0; changed != 0 && i < config_->outputs; ++i)
        if ((changed >> i & 1) != 0)
            put(config_->output[i].pin, (outputs_ >> i & 1) != 0, config_->output[i].is_inverted != 0);
}

}  // namespace gemelo
