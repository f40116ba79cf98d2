#include "wire.h"

#include "baud.h"
#include "board.h"
#include "driver/uart.h"
#include "esp_err.h"
#include "esp_timer.h"
#include "tasks.h"
#include "this_chip.h"

namespace gemelo {
namespace {

constexpr uart_port_t kPort = UART_NUM_0;
constexpr int kBuffer = 4096;
constexpr size_t kAtOnce = 256;
constexpr TickType_t kPatience = 1;

BaudSearch search;

void set_up() {
    uart_config_t config = {};
    config.baud_rate = static_cast<int>(search.rate());
    config.data_bits = UART_DATA_8_BITS;
    config.parity = UART_PARITY_DISABLE;
    config.stop_bits = UART_STOP_BITS_1;
    config.flow_ctrl = UART_HW_FLOWCTRL_DISABLE;
    config.source_clk = UART_SCLK_DEFAULT;
    ESP_ERROR_CHECK(uart_driver_install(kPort, kBuffer, kBuffer, 0, nullptr, 0));
    ESP_ERROR_CHECK(uart_param_config(kPort, &config));
    ESP_ERROR_CHECK(uart_set_pin(kPort, kThisChip.uart_tx, kThisChip.uart_rx, UART_PIN_NO_CHANGE, UART_PIN_NO_CHANGE));
}

void listen() {
    uint8_t bytes[kAtOnce];
    const int size = uart_read_bytes(kPort, bytes, sizeof bytes, kPatience);
    if (size <= 0) return;
    const uint64_t now_us = static_cast<uint64_t>(esp_timer_get_time());
    board.from_wire.push(static_cast<uint8_t>(Inbound::Bytes), 0, now_us, bytes, static_cast<size_t>(size));
    const uint32_t understood = __atomic_load_n(&board.understood, __ATOMIC_RELAXED);
    if (search.hear(static_cast<size_t>(size), understood, now_us)) uart_set_baudrate(kPort, search.rate());
}

void speak() {
    Record record;
    while (board.to_wire.front(&record)) {
        uart_write_bytes(kPort, record.bytes, record.size);
        board.to_wire.pop();
    }
}

void run(void*) {
    set_up();
    for (;;) {
        listen();
        speak();
    }
}

}  // namespace

void start_wire(uint32_t rate) {
    search = BaudSearch(rate);
    start_task(run, "wire", kWireStack, kWirePriority, kNetworkCore);
}

}  // namespace gemelo
