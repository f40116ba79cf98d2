#include "sensors.h"

#include "board.h"
#include "driver/gpio.h"
#include "echo.h"
#include "esp_err.h"
#include "esp_timer.h"
#include "factory_button.h"
#include "memory.h"
#include "pin_uses.h"
#include "tasks.h"
#include "this_chip.h"
#include "voltmeter.h"

namespace gemelo {
namespace {

constexpr uint32_t kRoundMs = 20;
constexpr uint32_t kMemoryMs = 10000;  // as often as `status` is said

// Few fields of a configuration that the slot's task may replace at any time.
struct Job {
    SensorKind kind;
    uint8_t pin;
    uint8_t trigger_pin;
};

// The slot's task writes the jobs while `count` is 0; a round that has begun with the old ones ends harmlessly.
struct Jobs {
    Job job[kMaxSensors];
    uint8_t count;
    bool has_button;  // the boot button's pin is nothing else
    uint32_t round_ms;
};

Jobs jobs;
Voltmeter voltmeter;
Echo echo;

bool measure(const Job& job, int32_t* raw) {
    if (job.kind == SensorKind::Analog) return voltmeter.measure(job.pin, raw);
    return echo.measure(job.trigger_pin, job.pin, raw);
}

void measure_all() {
    const uint8_t count = __atomic_load_n(&jobs.count, __ATOMIC_ACQUIRE);
    for (uint8_t i = 0; i < count; ++i) {
        int32_t raw = 0;
        if (!measure(jobs.job[i], &raw)) continue;
        board.from_sensors.push(static_cast<uint8_t>(Inbound::Sensor), i, 0, &raw, sizeof raw);
    }
}

bool is_button_pressed() {
    const bool is_low = gpio_get_level(static_cast<gpio_num_t>(kThisChip.boot_button)) == 0;
    return is_low && __atomic_load_n(&jobs.has_button, __ATOMIC_ACQUIRE);
}

bool uses_button_pin(const DeviceConfig& config) {
    for (const PinUse& use : PinUses(config))
        if (use.pin == kThisChip.boot_button) return true;
    return false;
}

// A pin that a configuration has let go is no input: it would read low, which is pressed.
void set_up_button() {
    gpio_config_t button = {};
    button.pin_bit_mask = pin(kThisChip.boot_button);
    button.mode = GPIO_MODE_INPUT;
    button.pull_up_en = GPIO_PULLUP_ENABLE;
    ESP_ERROR_CHECK(gpio_config(&button));
}

void run(void*) {
    voltmeter.begin();
    echo.begin(xTaskGetCurrentTaskHandle());
    FactoryButton button;
    uint32_t waited_ms = 0, memory_ms = kMemoryMs;
    for (;;) {
        vTaskDelay(pdMS_TO_TICKS(kRoundMs));
        const uint64_t now_us = static_cast<uint64_t>(esp_timer_get_time());
        if (button.is_held(is_button_pressed(), now_us))
            board.from_sensors.push(static_cast<uint8_t>(Inbound::FactoryReset), 0, now_us, nullptr, 0);
        waited_ms += kRoundMs;
        memory_ms += kRoundMs;
        if (memory_ms >= kMemoryMs) {
            measure_memory();
            memory_ms = 0;
        }
        if (waited_ms < __atomic_load_n(&jobs.round_ms, __ATOMIC_RELAXED)) continue;
        waited_ms = 0;
        measure_all();
    }
}

}  // namespace

void start_sensors() { start_task(run, "sensors", kSensorStack, kSensorPriority, kNetworkCore); }

void set_sensors(const DeviceConfig& config) {
    __atomic_store_n(&jobs.count, uint8_t{0}, __ATOMIC_RELEASE);
    for (uint8_t i = 0; i < config.sensors; ++i)
        jobs.job[i] = Job{config.sensor[i].kind, config.sensor[i].pin, config.sensor[i].trigger_pin};
    const bool has_button = !uses_button_pin(config);
    if (has_button) set_up_button();
    __atomic_store_n(&jobs.has_button, has_button, __ATOMIC_RELEASE);
    __atomic_store_n(&jobs.round_ms, config.sensor_hz == 0 ? 1000 : 1000 / config.sensor_hz, __ATOMIC_RELAXED);
    __atomic_store_n(&jobs.count, config.joints == 0 ? uint8_t{0} : config.sensors, __ATOMIC_RELEASE);
}

}  // namespace gemelo
