// The port of the serial wire: UART0, or with GEMELO_USB_WIRE the chip's own USB (USB-Serial-JTAG).
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace gemelo {

// Once, before all others; the rate counts on a UART only.
void open_port(uint32_t baud);
// Up to `size` bytes that have come; waits a moment for the first. Returns how many.
size_t read_port(uint8_t* bytes, size_t size);
// On USB lost whole where nobody on the other end reads.
void write_port(const uint8_t* bytes, size_t size);
void set_port_baud(uint32_t baud);

}  // namespace gemelo
