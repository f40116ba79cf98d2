// The serial wire's task: bytes from UART0 or from the chip's USB into the board's ring, and what the device says out
// of it; on a UART at the baud rate that was provisioned, or at that of whoever speaks.
#pragma once

#include <stdint.h>

namespace gemelo {

// `rate` as it was provisioned; 0: none was.
void start_wire(uint32_t rate);

}  // namespace gemelo
