// A stream that is steered while it moves: each message has the next knots and a full stop, with REPLACE.
#pragma once

#include <vector>

#include "random_path.h"

namespace property {

class LiveStream {
  public:
    // Begins at rest at `start`, Q24.8 steps.
    LiveStream(const gemelo::DeviceConfig& config, const std::vector<int32_t>& start, uint64_t seed);

    // The next message but for its stream and seq, from the first knot at `from_us` or later. `ends`: the stream ends
    // there.
    rig::ChunkSpec message(uint64_t from_us, bool ends);
    // One that no device may take: from a knot that it has passed at `played_us`, or from none that it has.
    rig::ChunkSpec wrong_message(uint64_t played_us);
    // The device has taken it: that is its path from there on.
    void take(const rig::ChunkSpec& chunk);

    // The end of the path that the device has.
    const rig::Row& target() const { return knots_.back().row; }
    uint64_t end_us() const { return knots_.back().time_us; }
    bool rests() const;
    bool is_over() const { return is_over_; }

  private:
    struct Knot {
        uint64_t time_us;
        rig::Row row;
    };
    rig::ChunkSpec from(const Knot& knot);

    const gemelo::DeviceConfig& config_;
    Dice dice_;
    std::vector<Knot> knots_;  // that the device has, and had
    bool is_over_ = false;
};

}  // namespace property
