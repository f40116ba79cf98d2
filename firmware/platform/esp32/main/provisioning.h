// The credentials of the board, sent once over the serial line: its name, its network, its broker. No answer tells it
// again.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "machine.h"
#include "provision.h"
#include "serial.h"

namespace gemelo {

class Provisioning {
  public:
    void begin(const Credentials& credentials, const SerialPort& serial) {
        credentials_ = &credentials;
        serial_ = &serial;
    }
    // Answers and, if it is taken, has the board restart a little later. `proposed` is room for the new ones, which
    // nobody needs once they are in the flash: what runs keeps the old ones until the restart. nullptr: there is none.
    void receive(const uint8_t* text, size_t size, const Machine& machine, Credentials* proposed, uint64_t now_us);
    void ask_for_factory_reset() { is_reset_asked_ = true; }
    // Never returns where a restart is due and nothing moves.
    void restart_if_due(const Machine& machine, uint64_t now_us);

  private:
    void answer(bool is_accepted, const char* reason) const;

    const Credentials* credentials_ = nullptr;
    const SerialPort* serial_ = nullptr;
    uint64_t restart_us_ = 0;  // 0: none is due
    bool is_reset_asked_ = false;
};

}  // namespace gemelo
