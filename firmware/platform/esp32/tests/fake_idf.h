// ESP-IDF as far as the layer uses it, in virtual time on the host: the layer itself runs as it is.
//
// The slot's task is a thread that gets its slots one by one; the tick's interrupt is called in between. The GPIO
// registers are memory at their own address.
#pragma once

#include <stdint.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "esp_event.h"
#include "esp_ota_ops.h"
#include "esp_system.h"
#include "freertos/task.h"
#include "mqtt_client.h"

namespace fake {

struct Restarted {};  // thrown by esp_restart()
struct Ended {};      // thrown where the task would wait for ever

constexpr int kAnalogMv = 1500, kPulledUpMv = 3100;  // [mV] what a pin at the ADC reads, and one that was let go

// The two slots for firmware, and what the boot loader knows of them.
struct Flash {
    std::string slot[2];
    int running = 0, boot = 0;
    esp_ota_img_states_t state = ESP_OTA_IMG_UNDEFINED;  // of the slot to boot
    bool is_open = false;                                // between esp_ota_begin() and esp_ota_end() or _abort()
    bool is_valid = true;                                // what esp_ota_end() finds
};

struct Chip {
    uint64_t now_us = 0;
    uint64_t waking_us = 0;       // from the interrupt that wakes the task until it runs
    uint64_t inputs = 0;          // levels, bit i: GPIO i
    uint64_t outputs = 0;         // levels
    uint64_t is_output = 0;       // bit i: GPIO i is set up as an output
    uint64_t is_input = 0;        // its level can be read; a pin that was let go reads low
    uint64_t is_analog = 0;       // it is at the ADC and has no pull resistor
    std::map<int, uint32_t> ups;  // rising edges of each output that the tick drives
    int servo_pin = -1;           // that LEDC drives
    uint32_t servo_hz = 0;
    uint32_t servo_duty = 0;       // of 2^14; 0: no pulses
    uint32_t servo_next_duty = 0;  // until it is asked for
    esp_reset_reason_t reset_reason = ESP_RST_POWERON;
    std::map<std::string, std::string> nvs;
    uint32_t flash_writes = 0;
    Flash flash;
    size_t heap_free = 0, heap_least = 0;
    std::map<TaskHandle_t, uint32_t> stack_left;
    std::string tls_authority, tls_certificate, tls_key;  // of the transport; empty: it was given none
    std::vector<std::string> subscriptions;               // topic and QoS
    esp_mqtt_client_config_t mqtt{};
    std::string will;
    esp_event_handler_t mqtt_handler = nullptr;
    void* mqtt_context = nullptr;
    std::vector<std::string> published;  // topic and retained
};

extern Chip chip;

// Everything but the flash, as after a reset.
void reset();

// Runs `task`, which waits for notifications, for as many slots as it is granted; the destructor ends it.
class Task {
  public:
    explicit Task(std::function<void()> task);
    ~Task();
    void grant(uint32_t slots);
    bool has_restarted() const { return has_restarted_; }

  private:
    bool has_restarted_ = false;
};

}  // namespace fake
