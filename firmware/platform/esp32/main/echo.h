// The length of an ultrasonic sensor's echo, measured by an interrupt at both of its edges.
#pragma once

#include <stdint.h>

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"

namespace gemelo {

class Echo {
  public:
    // The interrupts belong to the core that calls this.
    void begin(TaskHandle_t task);
    // Sends a ping and waits for its echo, at most 60 ms. False for none, or for a silly one.
    bool measure(uint8_t trigger_pin, uint8_t echo_pin, int32_t* echo_us);

  private:
    static void on_edge(void* self);

    TaskHandle_t task_ = nullptr;
    uint8_t pin_ = 0;
    uint32_t rose_us_ = 0;
    uint32_t length_us_ = 0;
};

}  // namespace gemelo
