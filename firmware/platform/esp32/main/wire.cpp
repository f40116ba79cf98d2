#include "wire.h"

#include "baud.h"
#include "board.h"
#include "esp_timer.h"
#include "tasks.h"
#include "wire_port.h"

namespace gemelo {
namespace {

constexpr size_t kAtOnce = 256;

BaudSearch search;

void listen() {
    uint8_t bytes[kAtOnce];
    const size_t size = read_port(bytes, sizeof bytes);
    if (size == 0) return;
    const uint64_t now_us = static_cast<uint64_t>(esp_timer_get_time());
    board.from_wire.push(static_cast<uint8_t>(Inbound::Bytes), 0, now_us, bytes, size);
    const uint32_t understood = __atomic_load_n(&board.understood, __ATOMIC_RELAXED);
    if (search.hear(size, understood, now_us)) set_port_baud(search.rate());
}

void speak() {
    Record record;
    while (board.to_wire.front(&record)) {
        write_port(record.bytes, record.size);
        board.to_wire.pop();
    }
}

void run(void*) {
    open_port(search.rate());
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
