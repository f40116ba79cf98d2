// The chip's own USB as the serial wire, for boards of an S3 or C3 that have no other socket. USB has no baud rate.
#if GEMELO_USB_WIRE

#include "driver/usb_serial_jtag.h"
#include "esp_err.h"
#include "wire_port.h"

namespace gemelo {
namespace {

constexpr uint32_t kBuffer = 4096;
constexpr TickType_t kPatience = 1;
// A reader on the other end empties the buffer in this time; without one each record waits so long, and is lost whole.
constexpr TickType_t kWritePatience = 5;

}  // namespace

void open_port(uint32_t) {
    usb_serial_jtag_driver_config_t config = {};
    config.tx_buffer_size = kBuffer;
    config.rx_buffer_size = kBuffer;
    ESP_ERROR_CHECK(usb_serial_jtag_driver_install(&config));
}

size_t read_port(uint8_t* bytes, size_t size) {
    const int found = usb_serial_jtag_read_bytes(bytes, static_cast<uint32_t>(size), kPatience);
    return found > 0 ? static_cast<size_t>(found) : 0;
}

void write_port(const uint8_t* bytes, size_t size) {
    if (usb_serial_jtag_is_connected()) usb_serial_jtag_write_bytes(bytes, size, kWritePatience);
}

void set_port_baud(uint32_t) {}

}  // namespace gemelo

#endif
