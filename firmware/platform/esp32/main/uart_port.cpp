// UART0 as the serial wire.
#if !GEMELO_USB_WIRE

#include "driver/uart.h"
#include "esp_err.h"
#include "this_chip.h"
#include "wire_port.h"

namespace gemelo {
namespace {

constexpr uart_port_t kPort = UART_NUM_0;
constexpr int kBuffer = 4096;
constexpr TickType_t kPatience = 1;

}  // namespace

void open_port(uint32_t baud) {
    uart_config_t config = {};
    config.baud_rate = static_cast<int>(baud);
    config.data_bits = UART_DATA_8_BITS;
    config.parity = UART_PARITY_DISABLE;
    config.stop_bits = UART_STOP_BITS_1;
    config.flow_ctrl = UART_HW_FLOWCTRL_DISABLE;
    config.source_clk = UART_SCLK_DEFAULT;
    ESP_ERROR_CHECK(uart_driver_install(kPort, kBuffer, kBuffer, 0, nullptr, 0));
    ESP_ERROR_CHECK(uart_param_config(kPort, &config));
    ESP_ERROR_CHECK(uart_set_pin(kPort, kThisChip.wire_tx, kThisChip.wire_rx, UART_PIN_NO_CHANGE, UART_PIN_NO_CHANGE));
}

size_t read_port(uint8_t* bytes, size_t size) {
    const int found = uart_read_bytes(kPort, bytes, static_cast<uint32_t>(size), kPatience);
    return found > 0 ? static_cast<size_t>(found) : 0;
}

void write_port(const uint8_t* bytes, size_t size) { uart_write_bytes(kPort, bytes, size); }

void set_port_baud(uint32_t baud) { uart_set_baudrate(kPort, baud); }

}  // namespace gemelo

#endif
