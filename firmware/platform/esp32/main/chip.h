// The pins of each chip: the GPIO summary of ESP-IDF 5.x and the chips' datasheets. Bit i is GPIO i.
#pragma once

#include <stdint.h>

namespace gemelo {

struct Chip {
    const char* name;
    uint64_t pins;        // that are there
    uint64_t input_only;  // neither output nor pull resistor
    uint64_t flash;       // the module's own flash is on them
    uint64_t psram;       // PSRAM, in some modules
    uint64_t strapping;   // their level at reset chooses how the chip starts
    uint64_t analog;      // ADC1; ADC2 cannot be used beside Wi-Fi
    uint8_t wire_tx;      // of the serial wire: UART0, or D- and D+ of the chip's USB
    uint8_t wire_rx;
    uint8_t boot_button;  // active low on the usual boards
    uint16_t image_id;    // esp_chip_id_t, which every image carries
};

constexpr uint64_t pin(uint8_t number) { return number < 64 ? 1ull << number : 0; }
constexpr uint64_t pins(uint8_t first, uint8_t last) {
    return ((1ull << (last - first + 1)) - 1) << first;  // never all 64
}

constexpr Chip kEsp32 = {
    "esp32",
    pins(0, 19) | pins(21, 23) | pins(25, 27) | pins(32, 39),
    pins(34, 39),
    pins(6, 11),
    pins(16, 17),
    pin(0) | pin(2) | pin(5) | pin(12) | pin(15),
    pins(32, 39),
    1,
    3,
    0,
    0,
};

constexpr Chip kEsp32S3 = {
    "esp32s3",
    pins(0, 21) | pins(26, 48),
    0,
    pins(26, 32),
    pins(33, 37),
    pin(0) | pin(3) | pin(45) | pin(46),
    pins(1, 10),
    43,
    44,
    0,
    9,
};

constexpr Chip kEsp32C3 = {
    "esp32c3", pins(0, 21), 0, pins(12, 17), 0, pin(2) | pin(8) | pin(9), pins(0, 4), 21, 20, 9, 5,
};

// The same chip on a board that has only its own USB: that is the serial wire, and UART0's pins are free.
constexpr Chip wired_by_usb(Chip chip, uint8_t minus, uint8_t plus) {
    chip.wire_tx = minus;
    chip.wire_rx = plus;
    return chip;
}

constexpr Chip kEsp32S3Usb = wired_by_usb(kEsp32S3, 19, 20);
constexpr Chip kEsp32C3Usb = wired_by_usb(kEsp32C3, 18, 19);

}  // namespace gemelo
