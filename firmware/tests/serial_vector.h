// The shared vectors of the serial line; bytes are written in hexadecimal.
#pragma once

#include <stdint.h>

#include <string>
#include <vector>

struct PacketVector {
    std::string name, sent;
    std::vector<std::string> frames;
    int bad;
};

// What a fresh device that speaks in lines answers at time 0.
struct LineVector {
    std::string name;
    std::vector<std::string> lines, answers;
    uint32_t lost, late;
};

// Taken where `reason` is empty.
struct ConfigVector {
    std::string name, text, part, reason;
};
