// The messages of a gateway that steers a moving arm: the next knots and a full stop in each.
#pragma once

#include <vector>

#include "rig.h"

namespace rig {

// A path of two joints, as messages with REPLACE make it; at most 3,000 steps/s^2 of the rig's 4,000.
class Steered {
  public:
    // From rest.
    explicit Steered(Rig& rig, uint32_t stream = 7);

    // The message that goes on from the first knot that is at least `ahead_us` away: `near` knots towards these
    // velocities [steps/s], and a tail to rest. Its seq is the next one.
    ChunkSpec message(double v0, double v1, size_t near = 6, uint64_t ahead_us = 5000);
    // The same from a knot of the path, 0 the first.
    ChunkSpec message_from(size_t knot, double v0, double v1, size_t near = 6);
    // Sends it; what the device takes is the path from then on.
    Ack send(const ChunkSpec& chunk);
    Ack steer(double v0, double v1, size_t near = 6) { return send(message(v0, v1, near)); }

    size_t knots() const { return rows_.size(); }
    uint64_t time_us(size_t knot) const { return times_us_[knot]; }
    const Row& row(size_t knot) const { return rows_[knot]; }
    // The last knot, at which the path rests.
    const Row& end() const { return rows_.back(); }
    uint64_t end_us() const { return times_us_.back(); }
    uint64_t played_us() const;
    // The path as it is to be played, in steps; within it.
    double position(size_t joint, uint64_t play_us) const;

  private:
    Rig& rig_;
    uint32_t stream_;
    uint32_t next_seq_ = 0;
    std::vector<Row> rows_;
    std::vector<uint64_t> times_us_;
};

// Every slot: on the path, and within velocities, accelerations and half a step.
class SteeredWatch {
  public:
    void look(Rig& rig, const Steered& path);
    // Lets so many slots pass and looks at each.
    void run_ms(Rig& rig, const Steered& path, uint32_t ms, bool silent = false);
    void expect_good(Rig& rig) const;

  private:
    static constexpr size_t kSpan = 4;  // slots
    double farthest_ = 0, fastest_ = 0, hardest_ = 0;
    std::vector<double> positions_[2];
};

}  // namespace rig
