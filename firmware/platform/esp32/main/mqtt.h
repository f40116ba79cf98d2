// MQTT: what arrives goes into the board's ring, what is said is published.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "assembly.h"
#include "esp_event.h"
#include "esp_transport.h"
#include "mqtt_client.h"
#include "provision.h"
#include "topics.h"

namespace gemelo {

constexpr char kClientIdPrefix[] = "gemelo-device-";

class Mqtt {
  public:
    static constexpr size_t kRandomDigits = 12;  // hexadecimal, at the end of the client id
    // Once; connects, and again for as long as it takes, in esp-mqtt's task. `credentials` must stay.
    void begin(const Credentials& credentials, uint32_t boot_id);
    bool is_connected() const { return __atomic_load_n(&is_connected_, __ATOMIC_ACQUIRE); }
    // Once more to everything that is sent to the device, if it is connected: its broker may have lost that. In the
    // task that publishes.
    void subscribe();
    // Waits at most as long as the network may take (2 s); lost where there is no connection.
    void publish(Output output, const uint8_t* bytes, size_t size);

  private:
    static void on_event(void* self, esp_event_base_t base, int32_t id, void* data);
    void connected();
    void subscribe_by(Topics& topics);
    void receive(const esp_mqtt_event_t& event);
    void deliver();

    char client_id_[sizeof kClientIdPrefix + sizeof Credentials::device + 1 + kRandomDigits] = {};
    esp_mqtt_client_handle_t client_ = nullptr;
    esp_transport_handle_t transport_ = nullptr;
    bool is_connected_ = false;
    Topics said_;   // of the task that publishes
    Topics heard_;  // of esp-mqtt's
    const Heard* topic_ = nullptr;
    bool is_retained_ = false;
    uint64_t received_us_ = 0;
    Assembly message_;  // in the board's ring
};

}  // namespace gemelo
