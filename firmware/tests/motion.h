// Motions to stream: as formulas in doubles, and as the knots that are sent.
#pragma once

#include <vector>

#include "rig.h"

namespace rig {

// One joint from rest to rest by a quintic; steps and seconds.
struct Move {
    double from, to, duration;

    double position(double t) const;
    double velocity(double t) const;
};

struct Motion {
    std::vector<Move> joints;
    double dt = 0.020;

    double duration() const { return joints[0].duration; }
    size_t knots() const;
    Row row(size_t i) const;
    // Knots from `begin` to before `end`, as the seq-th chunk.
    ChunkSpec chunk(size_t begin, size_t end, uint32_t seq, uint32_t stream = 7) const;
    // The whole motion in one chunk.
    ChunkSpec whole(uint32_t stream = 7) const { return chunk(0, knots(), 0, stream); }
    // The path as a device plays it, from the rounded knots.
    double played(size_t joint, double play_s) const;
};

// A motion of this duration that respects velocity and acceleration limits of 4000 steps/s and steps/s^2.
Motion quintic(const std::vector<double>& from, const std::vector<double>& to, double dt = 0.020);

// Sends a motion ahead of the device's clock, as a gateway does.
class Feeder {
  public:
    Feeder(const Motion& motion, uint32_t stream, size_t chunk_knots = 10, double lead_s = 1.0)
        : motion_(motion), stream_(stream), chunk_knots_(chunk_knots), lead_s_(lead_s) {}
    // Sends what is due; each chunk once.
    void feed(Rig& rig);
    bool is_done() const { return next_ >= motion_.knots(); }

  private:
    Motion motion_;
    uint32_t stream_;
    size_t chunk_knots_;
    double lead_s_;
    size_t next_ = 0;
    uint32_t seq_ = 0;
};

}  // namespace rig
