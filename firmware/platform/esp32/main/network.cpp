#include "network.h"

#include "board.h"
#include "esp_task_wdt.h"
#include "esp_timer.h"
#include "mqtt.h"
#include "tasks.h"
#include "wifi.h"

namespace gemelo {
namespace {

constexpr uint32_t kLongestWaitMs = 100;

const Credentials* credentials;
uint32_t boot_id;
Wifi wifi;
Mqtt mqtt;

void publish_all() {
    Record record;
    while (board.to_mqtt.front(&record)) {
        mqtt.publish(static_cast<Output>(record.kind), record.bytes, record.size);
        board.to_mqtt.pop();
        esp_task_wdt_reset();
    }
}

void run(void*) {
    ESP_ERROR_CHECK(esp_task_wdt_add(nullptr));
    wifi.begin(*credentials);
    bool has_begun = false;
    uint32_t silences = 0;
    for (;;) {
        ulTaskNotifyTake(pdTRUE, pdMS_TO_TICKS(kLongestWaitMs));
        esp_task_wdt_reset();
        wifi.turn(static_cast<uint64_t>(esp_timer_get_time()));
        if (wifi.is_up() && !has_begun) {
            has_begun = true;
            mqtt.begin(*credentials, boot_id);
        }
        publish_all();
        const uint32_t now = __atomic_load_n(&board.silences, __ATOMIC_RELAXED);
        if (now != silences) mqtt.subscribe();
        silences = now;
    }
}

}  // namespace

TaskHandle_t start_network(const Credentials& provisioned, uint32_t boot) {
    const bool is_provisioned =
        provisioned.device[0] != 0 && provisioned.wifi_ssid[0] != 0 && provisioned.mqtt_uri[0] != 0;
    if (!is_provisioned) return nullptr;
    credentials = &provisioned;
    boot_id = boot;
    return start_task(run, "network", kNetworkStack, kNetworkPriority, kNetworkCore);
}

}  // namespace gemelo
