// A TRAJ frame: its fields, and the checks of its knots.
#pragma once

#include <stdint.h>

#include "bounds.h"
#include "bytes.h"
#include "config.h"
#include "frame.h"
#include "knot_queue.h"

namespace gemelo {

constexpr size_t kChunkHeaderSize = 32;  // standard: PROTOCOL.md

// A view of a frame of at least kChunkHeaderSize bytes.
class Chunk {
  public:
    explicit Chunk(const Frame& frame) : frame_(frame) {}

    uint8_t joints() const { return frame_.joints(); }
    uint32_t boot_id() const { return frame_.boot_id(); }
    uint32_t stream() const { return load_u32(frame_.bytes + 8); }
    uint32_t seq() const { return load_u32(frame_.bytes + 12); }
    uint64_t expires_us() const { return load_u64(frame_.bytes + 16); }
    uint32_t dt_us() const { return load_u32(frame_.bytes + 24); }
    uint16_t knots() const { return load_u16(frame_.bytes + 28); }
    bool is_first() const { return (load_u16(frame_.bytes + 30) & kFlagFirst) != 0; }
    bool is_last() const { return (load_u16(frame_.bytes + 30) & kFlagLast) != 0; }
    bool has_right_size() const;
    void read_knot(uint16_t k, Knot* knot) const;

  private:
    Frame frame_;
};

// What the knots of a chunk must fit.
struct KnotRules {
    uint8_t joints;
    JointLimits limits[kMaxJoints];
};

// `before` is the knot that the chunk continues from; for a FIRST chunk, where the joints stand.
Verdict check_knots(const Chunk& chunk, const KnotRules& rules, const Knot& before);

}  // namespace gemelo
