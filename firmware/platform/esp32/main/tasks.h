// The core of each task: pulses and the slot have one alone where the chip has two; Wi-Fi is on the other.
#pragma once

#include "esp_err.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "memory.h"
#include "sdkconfig.h"

namespace gemelo {

#if CONFIG_FREERTOS_UNICORE
constexpr BaseType_t kSlotCore = 0;
#else
constexpr BaseType_t kSlotCore = 1;
#endif
constexpr BaseType_t kNetworkCore = 0;

constexpr UBaseType_t kSlotPriority = configMAX_PRIORITIES - 1;
constexpr UBaseType_t kWirePriority = 8;
constexpr UBaseType_t kNetworkPriority = 6;
constexpr UBaseType_t kSensorPriority = 2;

// Stacks in bytes.
constexpr uint32_t kSlotStack = 16384;  // of which checking a signature takes some 4 kB
constexpr uint32_t kWireStack = 4096;
constexpr uint32_t kNetworkStack = 6144;
constexpr uint32_t kSensorStack = 4096;

// A board without the memory for its tasks does not start.
inline TaskHandle_t start_task(TaskFunction_t code, const char* name, uint32_t stack, UBaseType_t priority,
                               BaseType_t core) {
    TaskHandle_t task = nullptr;
    const BaseType_t result = xTaskCreatePinnedToCore(code, name, stack, nullptr, priority, &task, core);
    ESP_ERROR_CHECK(result == pdPASS ? ESP_OK : ESP_ERR_NO_MEM);
    watch_stack(task, name);
    return task;
}

}  // namespace gemelo
