// A move of up to six joints from rest to rest as TRAJ frames: integers only, so every processor makes the same bytes.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "protocol.h"

constexpr uint8_t kMostJoints = 6;
constexpr uint32_t kBoot = 0x12345678;
constexpr uint16_t kLastKnot = 150;  // of 20 ms: 3 s
constexpr uint32_t kDtUs = 20000;
constexpr uint16_t kChunkKnots = 10;
constexpr uint16_t kReplacingKnots = 24;  // behind knot 0
constexpr size_t kFrameSize = 48 + (kReplacingKnots + 1) * 8 * kMostJoints + 4;

// One frame's bytes.
struct Wire {
    uint8_t bytes[kFrameSize];
    size_t size;
};

struct Move {
    uint32_t stream;
    uint8_t joints;
    const int32_t* from;      // steps
    const int32_t* distance;  // steps

    // Knots from `first`, at most kChunkKnots, as the seq-th chunk.
    Wire chunk(uint16_t first, uint32_t seq) const;
    // The same knots again: `first`, which the device has, and kReplacingKnots more at most.
    Wire replacement(uint16_t first, uint32_t seq) const;

  private:
    Wire begin(uint16_t first, uint16_t knots, uint32_t seq, uint16_t flags) const;
    Wire end(Wire wire, uint16_t first, uint16_t knots) const;
};

Wire command(gemelo::Command command, uint32_t id, uint16_t argument = 0);
Wire heartbeat(uint32_t counter);
