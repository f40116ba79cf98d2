#include "echo.h"

#include "driver/gpio.h"
#include "esp_err.h"
#include "esp_rom_sys.h"
#include "esp_timer.h"

namespace gemelo {
namespace {

constexpr uint32_t kPingUs = 10;
constexpr uint32_t kLongestUs = 38000;  // an HC-SR04 that hears nothing
constexpr TickType_t kPatience = pdMS_TO_TICKS(60);

uint32_t now_us() { return static_cast<uint32_t>(esp_timer_get_time()); }

}  // namespace

void Echo::begin(TaskHandle_t task) {
    task_ = task;
    ESP_ERROR_CHECK(gpio_install_isr_service(0));
}

bool Echo::measure(uint8_t trigger_pin, uint8_t echo_pin, int32_t* echo_us) {
    const gpio_num_t echo = static_cast<gpio_num_t>(echo_pin), trigger = static_cast<gpio_num_t>(trigger_pin);
    pin_ = echo_pin;
    ulTaskNotifyTake(pdTRUE, 0);
    if (gpio_set_intr_type(echo, GPIO_INTR_ANYEDGE) != ESP_OK) return false;
    if (gpio_isr_handler_add(echo, on_edge, this) != ESP_OK) return false;
    gpio_set_level(trigger, 1);
    esp_rom_delay_us(kPingUs);
    gpio_set_level(trigger, 0);
    const bool is_heard = ulTaskNotifyTake(pdTRUE, kPatience) != 0;
    gpio_isr_handler_remove(echo);
    *echo_us = static_cast<int32_t>(length_us_);
    return is_heard && length_us_ < kLongestUs;
}

void Echo::on_edge(void* self) {
    Echo& echo = *static_cast<Echo*>(self);
    if (gpio_get_level(static_cast<gpio_num_t>(echo.pin_)) != 0) {
        echo.rose_us_ = now_us();
        return;
    }
    echo.length_us_ = now_us() - echo.rose_us_;
    BaseType_t is_woken = pdFALSE;
    vTaskNotifyGiveFromISR(echo.task_, &is_woken);
    portYIELD_FROM_ISR(is_woken);
}

}  // namespace gemelo
