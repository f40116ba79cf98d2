// The wire over the chip's USB, on a driver that behaves as ESP-IDF's: whole records or nothing, and no long wait.
#include <gtest/gtest.h>

#include <cstring>
#include <string>

#include "driver/usb_serial_jtag.h"
#include "wire_port.h"

namespace {

struct Usb {
    size_t capacity = 0;  // of what goes out; 0: the driver is not installed
    bool is_connected = true;
    std::string out, in;
    TickType_t waited = 0;
} usb;

}  // namespace

extern "C" {
esp_err_t usb_serial_jtag_driver_install(usb_serial_jtag_driver_config_t* config) {
    if (usb.capacity != 0) return ESP_ERR_NO_MEM;
    usb.capacity = config->tx_buffer_size;
    return ESP_OK;
}
int usb_serial_jtag_read_bytes(void* bytes, uint32_t size, TickType_t) {
    const size_t found = usb.in.copy(static_cast<char*>(bytes), size);
    usb.in.erase(0, found);
    return static_cast<int>(found);
}
// As its ring buffer: all of it, or after the wait nothing.
int usb_serial_jtag_write_bytes(const void* bytes, size_t size, TickType_t patience) {
    if (usb.out.size() + size > usb.capacity) {
        usb.waited += patience;
        return 0;
    }
    usb.out.append(static_cast<const char*>(bytes), size);
    return static_cast<int>(size);
}
bool usb_serial_jtag_is_connected(void) { return usb.is_connected; }
}

TEST(UsbPort, CarriesBytesBothWaysAndHasNoBaudRate) {
    usb = Usb{};
    gemelo::open_port(921600);
    usb.in = "hello";
    uint8_t bytes[4];
    EXPECT_EQ(gemelo::read_port(bytes, sizeof bytes), 4u);
    EXPECT_EQ(gemelo::read_port(bytes, sizeof bytes), 1u);
    EXPECT_EQ(gemelo::read_port(bytes, sizeof bytes), 0u);
    gemelo::set_port_baud(115200);
    gemelo::write_port(reinterpret_cast<const uint8_t*>("frame"), 5);
    EXPECT_EQ(usb.out, "frame");
}

TEST(UsbPort, ARecordThatNobodyReadsIsLostWholeAfterAShortWait) {
    usb = Usb{};
    gemelo::open_port(0);
    const std::string record(1000, 'x');
    for (int i = 0; i < 6; ++i) gemelo::write_port(reinterpret_cast<const uint8_t*>(record.data()), record.size());
    EXPECT_EQ(usb.out.size(), 4000u);
    EXPECT_LE(usb.waited, 10u);
    usb.out.clear();
    usb.is_connected = false;
    usb.waited = 0;
    gemelo::write_port(reinterpret_cast<const uint8_t*>(record.data()), record.size());
    EXPECT_EQ(usb.out, "");
    EXPECT_EQ(usb.waited, 0u);
}
