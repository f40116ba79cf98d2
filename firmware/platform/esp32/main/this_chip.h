// The chip that this is compiled for.
#pragma once

#include "chip.h"
#include "sdkconfig.h"

namespace gemelo {

#if GEMELO_USB_WIRE && CONFIG_IDF_TARGET_ESP32S3
inline constexpr const Chip& kThisChip = kEsp32S3Usb;
#elif GEMELO_USB_WIRE && CONFIG_IDF_TARGET_ESP32C3
inline constexpr const Chip& kThisChip = kEsp32C3Usb;
#elif GEMELO_USB_WIRE
#error "this chip has no USB of its own: build it without GEMELO_USB_WIRE"
#elif CONFIG_IDF_TARGET_ESP32
inline constexpr const Chip& kThisChip = kEsp32;
#elif CONFIG_IDF_TARGET_ESP32S3
inline constexpr const Chip& kThisChip = kEsp32S3;
#elif CONFIG_IDF_TARGET_ESP32C3
inline constexpr const Chip& kThisChip = kEsp32C3;
#else
#error "this chip has no table of pins yet: add it to chip.h"
#endif

}  // namespace gemelo
