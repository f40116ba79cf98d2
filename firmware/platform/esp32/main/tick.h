// The tick: a timer interrupt that reads the pins, steps and drives the pins. It runs while the flash is being written.
#pragma once

#include <stdint.h>

#include "driver/gptimer.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "pin_map.h"
#include "stepper.h"

namespace gemelo {

class Tick {
  public:
    // The interrupt belongs to the core that calls this; it wakes `slot_task` after the first tick of every slot.
    void begin(Stepper& stepper, TaskHandle_t slot_task);
    // At the first tick of a slot of `config`.
    void start(const DeviceConfig& config);
    void stop();
    void resume();

    // Device time of the present slot's first tick.
    uint64_t slot_start_us() const;

  private:
    static bool on_alarm(gptimer_handle_t timer, const gptimer_alarm_event_data_t* event, void* self);
    void drive();
    bool wake();

    gptimer_handle_t timer_ = nullptr;
    TaskHandle_t slot_task_ = nullptr;
    Stepper* stepper_ = nullptr;
    Pins driven_;
    uint32_t ticks_per_slot_ = 0;
    uint32_t tick_in_slot_ = 0;
    uint32_t slot_start_low_us_ = 0;  // one word, so it cannot be read half
    bool is_running_ = false;
    PinTable step_pins_;
    PinTable dir_pins_;
};

}  // namespace gemelo
