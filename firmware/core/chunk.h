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
constexpr size_t kReplacementSize = 16;  // standard: PROTOCOL.md, what REPLACE adds to it

// A frame's fields, and its knots as they lie there; of a frame of at least kChunkHeaderSize bytes.
class Chunk {
  public:
    explicit Chunk(const Frame& frame);

    uint8_t joints() const { return frame_.joints(); }
    uint32_t boot_id() const { return boot_id_; }
    uint32_t stream() const { return stream_; }
    uint32_t seq() const { return seq_; }
    uint64_t expires_us() const { return expires_us_; }
    uint32_t dt_us() const { return dt_us_; }
    uint16_t knots() const { return knots_; }
    bool is_first() const { return (flags_ & kFlagFirst) != 0; }
    bool is_last() const { return (flags_ & kFlagLast) != 0; }
    bool is_replacement() const { return (flags_ & kFlagReplace) != 0; }
    bool has_right_size() const;

    // Zero but in a replacement.
    uint64_t from_us() const { return from_us_; }
    uint32_t tail_dt_us() const { return tail_dt_us_; }
    uint16_t tail() const { return tail_; }

    // The first knot that the path has not got yet.
    uint16_t begin() const { return is_first() || is_replacement() ? 1 : 0; }
    void read_knot(uint16_t k, Knot* knot) const;
    // Knot 0 is this one, bit by bit.
    bool begins_with(const Knot& knot) const;
    bool ends_at_rest() const;

  private:
    Frame frame_;
    uint32_t boot_id_, stream_, seq_, dt_us_, tail_dt_us_ = 0;
    uint64_t expires_us_, from_us_ = 0;
    uint16_t knots_, flags_, tail_ = 0;
    uint16_t header_size_ = kChunkHeaderSize;
};

// What the knots of a chunk must fit.
struct KnotRules {
    uint8_t joints;
    JointLimits limits[kMaxJoints];
};

// `before` is the knot that the chunk continues from, which is knot 0 of a replacement; for a FIRST chunk, where the
// joints stand.
Verdict check_knots(const Chunk& chunk, const KnotRules& rules, const Knot& before);

}  // namespace gemelo
