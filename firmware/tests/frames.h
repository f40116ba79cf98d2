// Frames as a gateway builds them.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <optional>
#include <vector>

#include "protocol.h"
#include "update.h"

namespace rig {

constexpr uint32_t kBoot = 0x12345678;
constexpr uint64_t kNever = UINT64_MAX;

using Bytes = std::vector<uint8_t>;

struct Row {
    std::vector<int32_t> position;
    std::vector<int32_t> velocity;
};

// What REPLACE adds.
struct Replacing {
    uint64_t from_us = 0;
    uint16_t tail = 0;
    uint32_t tail_dt_us = 20000;
};

struct ChunkSpec {
    uint32_t stream = 7;
    uint32_t seq = 0;
    std::vector<Row> rows;
    bool first = false;
    bool last = false;
    uint32_t dt_us = 20000;
    uint64_t expires_us = kNever;
    uint32_t boot_id = kBoot;
    std::optional<Replacing> replacing = std::nullopt;

    // From knot k - 1 to knot k.
    uint32_t dt_to(size_t k) const;
};

Bytes build(const ChunkSpec& chunk);
Bytes build_command(gemelo::Command command, uint32_t id, const std::vector<int32_t>& position = {},
                    uint64_t expires_us = kNever, uint32_t boot_id = kBoot, uint8_t index = 0, uint16_t argument = 0);
Bytes build_heartbeat(uint32_t session, uint32_t counter, uint32_t boot_id = 0);
Bytes build_sync(uint64_t t0);
Bytes build_update(gemelo::UpdateStep step, uint32_t session, uint32_t offset = 0, const Bytes& content = {},
                   uint32_t boot_id = kBoot);
// The content of a BEGIN: `size`, a digest of bytes `digest`, and a signature of eight bytes.
Bytes build_update_begin(uint32_t size, uint8_t digest);
// Appends the CRC.
Bytes seal(Bytes bytes);

}  // namespace rig
