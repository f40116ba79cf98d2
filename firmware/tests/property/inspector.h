// Holds a device against its properties at the end of every slot.
//
// Acceleration is measured from the path's positions p at slot ends, as the device itself has them (Q20 steps). The
// mean velocity of slot k is v(k) = (p(k) - p(k-1)) / 1 ms. Over 16 slots it may change by 1.1 A 16 ms; over w = 1 and
// 4 slots by 1.1 A (w + 1) ms, because the time scale is one number for a slot and a knot may lie within it. Knots are
// rounded to 1/256 step, which is not the device's doing: between two of them, dt apart, that shifts a velocity by up
// to 1.5 (1/256) / dt + 1/512 steps/s, and the two velocities by twice that.
#pragma once

#include <array>

#include "findings.h"
#include "machine.h"
#include "oscilloscope.h"
#include "played_path.h"

namespace property {

class Inspector {
  public:
    Inspector(const Bench& bench, const gemelo::Machine& machine, Findings& findings);

    // At the end of every slot, before the next one's first tick.
    void look(Oscilloscope& scope);
    // The FIRST chunk of `stream` was taken: from its first slot on the path is this one.
    void expect_stream(uint32_t stream, const PlayedPath& path);
    // Further chunks of it.
    PlayedPath& path() { return next_.stream != 0 ? next_.path : path_; }
    // The device has stopped dead or was told where it stands: it is somewhere else from here on.
    void start_anew(Oscilloscope& scope);

    // Homing has given this joint, which stands, another count.
    void recount(uint8_t joint, const Oscilloscope& scope);

  private:
    static constexpr size_t kWindow = 16;
    struct Axis {
        int64_t p_q20 = 0;
        int64_t offset = 0;  // the device's step count less the oscilloscope's
        double fastest, harshest;
        std::array<double, kWindow + 1> v{};  // steps/s, a ring
    };
    struct Expected {
        uint32_t stream = 0;
        PlayedPath path;
    };
    void check_steps(const Oscilloscope& scope);
    void check_spread(const Oscilloscope& scope, uint8_t joint, int64_t p_q20);
    void check_path(const gemelo::Point& point);
    void check_limits(uint8_t joint, double shift);
    void switch_stream(const gemelo::Point& point);
    bool stands(const gemelo::Point& point) const;
    double shortest_dt() const;

    const Bench& bench_;
    const gemelo::Machine& machine_;
    Findings& findings_;
    std::vector<Axis> axis_;
    PlayedPath path_;
    Expected next_;
    uint32_t stream_ = 0;
    uint64_t play_us_ = 0;
    uint64_t slots_ = 0;
    uint64_t slot_begin_ = 1;  // tick
    std::array<double, kWindow + 1> dt_;
    std::vector<double> jump_;  // of this slot, steps
};

}  // namespace property
