// Wi-Fi as a station that never sleeps and never gives up.
#pragma once

#include <stdint.h>

#include "back_off.h"
#include "esp_event.h"
#include "provision.h"

namespace gemelo {

class Wifi {
  public:
    void begin(const Credentials& credentials);
    // Tries again where that is due; returns at once.
    void turn(uint64_t now_us);
    bool is_up() const { return __atomic_load_n(&is_up_, __ATOMIC_ACQUIRE); }

  private:
    static void on_event(void* self, esp_event_base_t base, int32_t id, void* data);
    void set_up_station(const Credentials& credentials);

    BackOff back_off_;
    bool is_up_ = false;
    bool has_failed_ = false;  // set by the event's task, taken by turn()
};

}  // namespace gemelo
