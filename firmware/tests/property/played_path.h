// The path that a stream's chunks describe, in doubles and on its own: where the joints must be at a stream time.
#pragma once

#include <array>
#include <vector>

#include "config.h"
#include "frames.h"

namespace property {

class PlayedPath {
  public:
    void begin(const rig::ChunkSpec& first);
    void add(const rig::ChunkSpec& chunk);
    // With REPLACE: what follows its knot 0 is forgotten.
    void replace(const rig::ChunkSpec& chunk);

    // Moves on to a stream time [us], which never falls; false beyond the last knot.
    bool seek(uint64_t play_us);
    // There, in steps and steps/s.
    double position(uint8_t joint) const { return evaluate(joint).position; }
    double velocity(uint8_t joint) const { return evaluate(joint).velocity; }
    // The shortest time step that seek() has just passed through [s].
    double shortest_dt() const { return shortest_dt_; }
    const rig::Row& end() const { return end_; }
    uint64_t end_us() const { return spans_.empty() ? 0 : spans_.back().begin_us + spans_.back().dt_us; }

  private:
    struct Span {
        uint64_t begin_us;
        uint32_t dt_us;
        rig::Row from, to;
    };
    struct Place {
        double position, velocity;
    };
    Place evaluate(uint8_t joint) const;

    std::vector<Span> spans_;
    rig::Row start_, end_;
    size_t at_ = 0;
    uint64_t play_us_ = 0;
    double shortest_dt_ = 1;
};

}  // namespace property
