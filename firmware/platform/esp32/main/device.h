// The slot's task: the machine, fed from the rings and heard into them. Nothing else touches the machine but the tick.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "config_text.h"
#include "feeding.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "machine.h"
#include "ota.h"
#include "pins.h"
#include "pose_memory.h"
#include "provisioning.h"
#include "ring.h"
#include "serial.h"
#include "tick.h"

namespace gemelo {

class Device {
  public:
    // `credentials` must stay.
    void begin(const Credentials& credentials, uint32_t boot_id);
    // Who is woken when there is something to publish; nullptr for nobody.
    void set_network(TaskHandle_t task) { network_ = task; }
    // Never returns.
    void run();

  private:
    static void put(void* self, Output output, const uint8_t* bytes, size_t size);
    static void keep(void* self, const uint8_t* text, size_t size);
    static ConfigFault check(void* self, const DeviceConfig& config);
    static void other(void* self, FrameType type, const uint8_t* text, size_t size);

    void load_config();
    void wake_up();
    void serve();
    template <uint32_t kCapacity>
    bool take_from(Ring<kCapacity>& ring);
    void take(const Record& record);
    void dispatch(const Record& record);
    void set_up();
    void warn();
    void remember();
    void keep_config();

    DeviceConfig config_{};
    Machine machine_;
    SerialPort serial_;
    Tick tick_;
    SlowPins pins_;
    Provisioning provisioning_;
    Ota ota_;
    bool is_connected_ = false;  // to the broker, some time since the start
    TaskHandle_t network_ = nullptr;
    const char* device_ = "";
    uint32_t boot_id_ = 0;
    char reset_cause_[40] = "";
    Pose kept_{};
    bool is_awake_ = false;  // the first slot is over
    Feeding feeding_;
    size_t text_size_ = 0;  // of a configuration that is to be written
    // One room for what is to be written into the flash: it is never both.
    union Scratch {
        constexpr Scratch() : text{} {}
        char text[kMaxConfigText];
        Credentials proposed;
    } scratch_;
};

}  // namespace gemelo
