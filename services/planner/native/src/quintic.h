// The quintics through a trajectory's points, and the step rates of the stream that is made of them: what a finished
// trajectory is verified by, in doubles.
//
// The operations stand in the order of services/planner/verification, which computes the same where this is not built.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace gemelo {

// Points by rows: `stamps` (points,) [s], positions, velocities and accelerations (points, dof).
struct TrajectoryView {
    const double *stamps, *positions, *velocities, *accelerations;
    size_t dof;
};

// Where a sample is written, (dof,) each.
struct SampleView {
    double *positions, *velocities, *accelerations, *jerks;
};

// At `time` [s], in the segment that begins with the point `index` (Biagiotti and Melchiorri 2008, section 2.1).
inline void sample_quintic(const TrajectoryView& trajectory, double time, size_t index, const SampleView& sample) {
    const double dt = trajectory.stamps[index + 1] - trajectory.stamps[index];
    const double u = (time - trajectory.stamps[index]) / dt, squared = dt * dt, cubed = std::pow(dt, 3.0);
    const size_t from = index * trajectory.dof, to = from + trajectory.dof;
    for (size_t i = 0; i < trajectory.dof; ++i) {
        const double p0 = trajectory.positions[from + i], v0 = trajectory.velocities[from + i] * dt,
                     a0 = trajectory.accelerations[from + i] * dt * dt;
        const double rise = trajectory.positions[to + i] - p0 - v0 - 0.5 * a0;
        const double climb = trajectory.velocities[to + i] * dt - v0 - a0,
                     bend = trajectory.accelerations[to + i] * dt * dt - a0;
        const double third = 10.0 * rise - 4.0 * climb + bend / 2.0, fourth = -15.0 * rise + 7.0 * climb - bend,
                     fifth = 6.0 * rise - 3.0 * climb + bend / 2.0;
        sample.positions[i] = p0 + u * (v0 + u * (a0 / 2.0 + u * (third + u * (fourth + u * fifth))));
        sample.velocities[i] = (v0 + u * (a0 + u * (3.0 * third + u * (4.0 * fourth + u * 5.0 * fifth)))) / dt;
        sample.accelerations[i] = (a0 + u * (6.0 * third + u * (12.0 * fourth + u * 20.0 * fifth))) / squared;
        sample.jerks[i] = (6.0 * third + u * (24.0 * fourth + u * 60.0 * fifth)) / cubed;
    }
}

// The stream between knots: start + u (2 square + u 3 cube) per knot, (knots, dof) each in 1/256 steps, u at `slots`
// even places up to the next knot; `knot` [1/256 steps per step/s] is what turns it into steps/s.
struct StreamView {
    const double *start, *square, *cube;
    size_t knots, dof, slots;
    double knot;
};

// The largest rate [steps/s] of each joint, into `peaks` (dof,); what is no number is larger than all others.
inline void peak_rates(const StreamView& stream, const double* shares, double* peaks) {
    std::fill_n(peaks, stream.dof, 0.0);
    const double cubic = 3.0 / stream.knot, quadratic = 2.0 / stream.knot;
    for (size_t row = 0; row < stream.knots; ++row) {
        for (size_t i = 0; i < stream.dof; ++i) {
            const size_t at = row * stream.dof + i;
            const double cube = cubic * stream.cube[at], square = quadratic * stream.square[at],
                         start = stream.start[at] / stream.knot;
            for (size_t slot = 0; slot < stream.slots; ++slot) {
                const double rate = std::abs(shares[slot] * (shares[slot] * cube + square) + start);
                if (!(rate <= peaks[i])) peaks[i] = rate;
            }
        }
    }
}

}  // namespace gemelo
