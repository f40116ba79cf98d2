#include "tick.h"

#include "board_check.h"
#include "esp_attr.h"
#include "esp_err.h"
#include "esp_timer.h"
#include "sdkconfig.h"
#include "soc/gpio_reg.h"
#include "soc/soc_caps.h"

#if !CONFIG_GPTIMER_ISR_IRAM_SAFE && !CONFIG_GPTIMER_ISR_CACHE_SAFE
#error "the tick would stand still while the flash is written: take sdkconfig.defaults"
#endif

#define TICK_INLINE __attribute__((always_inline)) inline

namespace gemelo {
namespace {

constexpr int kPriority = 3;  // the highest that may wake a task: over the kernel's own tick and every driver

TICK_INLINE volatile uint32_t& gpio(uint32_t address) {
    return *reinterpret_cast<volatile uint32_t*>(static_cast<uintptr_t>(address));
}

TICK_INLINE Levels read_levels() {
    Levels levels;
    levels.low = gpio(GPIO_IN_REG);
#if SOC_GPIO_PIN_COUNT > 32
    levels.high = gpio(GPIO_IN1_REG);
#endif
    return levels;
}

// The W1TS and W1TC registers change only the bits that are written as 1: no other pin is touched.
TICK_INLINE void write(const Banks& raised, const Banks& lowered) {
    gpio(GPIO_OUT_W1TS_REG) = raised.low;
    gpio(GPIO_OUT_W1TC_REG) = lowered.low;
#if SOC_GPIO_PIN_COUNT > 32
    gpio(GPIO_OUT1_W1TS_REG) = raised.high;
    gpio(GPIO_OUT1_W1TC_REG) = lowered.high;
#endif
}

TICK_INLINE void follow(const PinTable& table, uint32_t joints, uint32_t* driven) {
    const uint32_t changed = joints ^ *driven;
    if (changed == 0) return;
    write(table[joints & changed], table[*driven & changed]);
    *driven = joints;
}

}  // namespace

void Tick::begin(Stepper& stepper, TaskHandle_t slot_task) {
    stepper_ = &stepper;
    slot_task_ = slot_task;
    gptimer_config_t config = {};
    config.clk_src = GPTIMER_CLK_SRC_DEFAULT;
    config.direction = GPTIMER_COUNT_UP;
    config.resolution_hz = kTimerHz;
    config.intr_priority = kPriority;
    ESP_ERROR_CHECK(gptimer_new_timer(&config, &timer_));
    gptimer_event_callbacks_t callbacks = {};
    callbacks.on_alarm = on_alarm;
    ESP_ERROR_CHECK(gptimer_register_event_callbacks(timer_, &callbacks, this));
    ESP_ERROR_CHECK(gptimer_enable(timer_));
}

void Tick::start(const DeviceConfig& config) {
    uint8_t step[kMaxJoints], dir[kMaxJoints];
    for (uint8_t j = 0; j < kMaxJoints; ++j) {
        step[j] = j < config.joints ? config.joint[j].step_pin : kNone;
        dir[j] = j < config.joints ? config.joint[j].dir_pin : kNone;
    }
    step_pins_.begin(step);
    dir_pins_.begin(dir);
    driven_ = Pins{};
    drive();
    ticks_per_slot_ = ticks_per_slot(config);
    tick_in_slot_ = 0;
    slot_start_low_us_ = static_cast<uint32_t>(esp_timer_get_time());
    gptimer_alarm_config_t alarm = {};
    alarm.alarm_count = kTimerHz / config.tick_hz;
    alarm.flags.auto_reload_on_alarm = true;
    ESP_ERROR_CHECK(gptimer_set_raw_count(timer_, 0));
    ESP_ERROR_CHECK(gptimer_set_alarm_action(timer_, &alarm));
    resume();
}

void Tick::stop() {
    if (is_running_) ESP_ERROR_CHECK(gptimer_stop(timer_));
    is_running_ = false;
}

void Tick::resume() {
    if (ticks_per_slot_ != 0) ESP_ERROR_CHECK(gptimer_start(timer_));
    is_running_ = ticks_per_slot_ != 0;
}

uint64_t Tick::slot_start_us() const {
    const uint64_t now_us = static_cast<uint64_t>(esp_timer_get_time());
    if (!is_running_) return now_us;
    const uint32_t low_us = __atomic_load_n(&slot_start_low_us_, __ATOMIC_RELAXED);
    return now_us - (static_cast<uint32_t>(now_us) - low_us);
}

TICK_INLINE void Tick::drive() {
    const Pins& pins = stepper_->pins();
    follow(dir_pins_, pins.dir, &driven_.dir);
    follow(step_pins_, pins.step, &driven_.step);
}

// After the pins: the kernel's spinlock, which the other core may hold for a moment, cannot delay a pulse of this tick.
TICK_INLINE bool Tick::wake() {
    BaseType_t is_woken = pdFALSE;
    if (tick_in_slot_ == 0) {
        __atomic_store_n(&slot_start_low_us_, static_cast<uint32_t>(esp_timer_get_time()), __ATOMIC_RELAXED);
        vTaskNotifyGiveFromISR(slot_task_, &is_woken);
    }
    if (++tick_in_slot_ == ticks_per_slot_) tick_in_slot_ = 0;
    return is_woken == pdTRUE;
}

bool IRAM_ATTR Tick::on_alarm(gptimer_handle_t, const gptimer_alarm_event_data_t*, void* self) {
    Tick& tick = *static_cast<Tick*>(self);
    tick.stepper_->tick(read_levels());
    tick.drive();
    return tick.wake();
}

}  // namespace gemelo
