// Who runs where. Pulses and the slot have one core for themselves where the chip has two; Wi-Fi is on the other.
#pragma once

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
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
constexpr uint32_t kSlotStack = 12288;
constexpr uint32_t kWireStack = 4096;
constexpr uint32_t kNetworkStack = 6144;
constexpr uint32_t kSensorStack = 4096;

}  // namespace gemelo
