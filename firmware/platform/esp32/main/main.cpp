// The start: what the flash knows, then the tasks.
#include "baud.h"
#include "board.h"
#include "bootloader_random.h"
#include "device.h"
#include "esp_err.h"
#include "esp_log.h"
#include "esp_random.h"
#include "esp_task_wdt.h"
#include "network.h"
#include "report.h"
#include "reset_cause.h"
#include "sensors.h"
#include "store.h"
#include "tasks.h"
#include "this_chip.h"
#include "wire.h"

namespace gemelo {

Board board;

namespace {

constexpr uint32_t kWatchdogMs = 5000;  // longer than the flash or the network may take

Device device;  // in internal RAM, as all static data: the tick runs while the flash cannot be read
Credentials credentials;

// Before Wi-Fi runs the generator has no entropy of its own.
uint32_t random_boot_id() {
    bootloader_random_enable();
    const uint32_t random = esp_random();
    bootloader_random_disable();
    return random == 0 ? 1 : random;
}

void start_watchdog() {
    esp_task_wdt_config_t config = {};
    config.timeout_ms = kWatchdogMs;
    config.idle_core_mask = 0;
    config.trigger_panic = true;
    ESP_ERROR_CHECK(esp_task_wdt_reconfigure(&config));
}

// On the console of the debug builds; the others have none, and compile this to nothing.
void say_hello() {
    ESP_LOGI("gemelo", "firmware %s for %s, reset cause %s, device \"%s\", %s", kFirmwareVersion, kThisChip.name,
             reset_cause().text, credentials.device, credentials.wifi_ssid[0] != 0 ? "Wi-Fi" : "cable only");
}

void run_device(void*) { device.run(); }

void start() {
    open_store();
    load_credentials(&credentials);
    say_hello();
    start_watchdog();
    const uint32_t boot_id = random_boot_id();
    device.begin(credentials, boot_id);
    start_wire(read_baud(credentials.serial_baud));
    device.set_network(start_network(credentials, boot_id));
    start_sensors();
    start_task(run_device, "slot", kSlotStack, kSlotPriority, kSlotCore);
}

}  // namespace
}  // namespace gemelo

extern "C" void app_main() { gemelo::start(); }
