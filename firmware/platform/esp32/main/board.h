// Data that the tasks share: rings between them, and a counter. Each ring has one writer and one reader.
#pragma once

#include <stdint.h>

#include "ring.h"

namespace gemelo {

// What a record to the slot's task is.
enum class Inbound : uint8_t {
    Frame,         // of MQTT; flags: kRetained
    Config,        // text of MQTT
    Connected,     // to the broker
    Bytes,         // of the serial wire, as they came
    Sensor,        // flags: its index; bytes: i32 raw
    FactoryReset,  // asked for with the button
};

constexpr uint8_t kRetained = 1;

// Records to the network and to the wire have their Output as kind; the wire's bytes are ready to be sent.
struct Board {
    // Written in esp-mqtt's task. Twice the longest message: a chunk has up to 8,228 bytes, a configuration 8,220.
    Ring<16640> from_mqtt;
    Ring<8192> from_wire;
    Ring<1024> from_sensors;
    Ring<8192> to_mqtt;
    Ring<8192> to_wire;
    uint32_t understood = 0;  // frames and lines of the wire; written in the slot's task, atomically
    uint32_t silences = 0;    // that asked for another subscription; the same
};

extern Board board;

}  // namespace gemelo
