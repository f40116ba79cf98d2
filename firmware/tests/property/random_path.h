// A random path that the joints can follow: within positions, velocities and accelerations, at them often.
#pragma once

#include <vector>

#include "config.h"
#include "dice.h"
#include "frames.h"

namespace property {

class RandomPath {
  public:
    // Begins at rest at `start`, Q24.8 steps.
    RandomPath(const gemelo::DeviceConfig& config, std::vector<int32_t> start, uint64_t seed);
    // Begins at a row of such a path.
    RandomPath(const gemelo::DeviceConfig& config, const rig::Row& start, uint64_t seed);

    // The next chunk but for its stream and numbers; the last one once `end` was called and all joints stand.
    rig::ChunkSpec next();
    // The same as one message with REPLACE, but for its place: a few knots, and a tail to rest.
    rig::ChunkSpec steered();
    // From now on the joints only brake.
    void end() { is_ending_ = true; }
    bool is_over() const { return is_over_; }

  private:
    struct Joint {
        int32_t p, v;    // Q24.8
        int64_t target;  // velocity that it tends to
        gemelo::JointConfig limits;
        int32_t fastest;
    };
    uint32_t random_dt();
    uint32_t tail_dt();
    void add_row(uint32_t dt_us, rig::ChunkSpec* chunk);
    int64_t random_target(const Joint& joint);
    void move(Joint& joint, uint32_t dt_us);
    bool can_stop(const Joint& joint, int64_t p, int64_t v) const;
    bool stands() const;
    rig::Row row() const;

    Dice dice_;
    std::vector<Joint> joints_;
    int pace_;  // which time steps it takes
    bool is_first_ = true, is_ending_ = false, is_over_ = false;
};

}  // namespace property
