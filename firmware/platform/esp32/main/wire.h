// The serial wire's task: bytes from UART0 into the board's ring, and what the device says out of it.
#pragma once

namespace gemelo {

void start_wire();

}  // namespace gemelo
