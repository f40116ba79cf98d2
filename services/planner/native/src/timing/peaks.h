// The largest velocity, acceleration and jerk of the quintics through a trajectory's points, between them too; the
// operations stand in the order of services/planner/timing/timing.py.
#pragma once

#include <algorithm>
#include <cmath>

#include "states.h"

namespace gemelo {

struct PeakShares {
    double velocity = 0.0, acceleration = 0.0, jerk = 0.0;
};

constexpr double kLooks[3] = {0.25, 0.5, 0.75};  // of a segment, at which velocities are looked at

// The share within the segment; 0 for others, and for what is no number.
inline double inside_segment(double share) { return share > 0.0 && share < 1.0 ? share : 0.0; }

// The largest shares of any joint's limits. Jerk and acceleration are taken where their derivatives are zero; to a
// velocity comes what it may gain between two looks (Biagiotti and Melchiorri 2008, section 2.1).
inline PeakShares peak_shares(const States& states, const LimitsView& limits) {
    PeakShares most;
    const size_t dof = limits.dof;
    for (size_t row = 0; row + 1 < states.times.size(); ++row) {
        const double dt = states.times[row + 1] - states.times[row];
        for (size_t i = 0; i < dof; ++i) {
            const size_t from = row * dof + i, to = from + dof;
            const double v0 = states.velocities[from] * dt, v1 = states.velocities[to] * dt;
            const double a0 = states.accelerations[from] * dt * dt, a1 = states.accelerations[to] * dt * dt;
            const double rise = states.positions[to] - states.positions[from] - v0 - 0.5 * a0;
            const double climb = v1 - v0 - a0, bend = a1 - a0;
            const double third = 10.0 * rise - 4.0 * climb + 0.5 * bend, fourth = -15.0 * rise + 7.0 * climb - bend,
                         fifth = 6.0 * rise - 3.0 * climb + 0.5 * bend;
            const double c0 = 6.0 * third, c1 = 24.0 * fourth, c2 = 60.0 * fifth;  // of the jerk, by powers of u
            const double summit = inside_segment(-c1 / (2.0 * c2)), root = std::sqrt(c1 * c1 - 4.0 * c0 * c2);
            double jerk = std::max(std::abs(c0), std::abs(c0 + c1 + c2));
            jerk = std::max(jerk, std::abs(c0 + summit * (c1 + summit * c2)));
            double acceleration = std::max(std::abs(a0), std::abs(a1));
            for (const double still : {(root - c1) / (2.0 * c2), (-root - c1) / (2.0 * c2), -c0 / c1}) {
                const double u = inside_segment(still);
                acceleration = std::max(acceleration, std::abs(a0 + u * (c0 + u * (c1 / 2.0 + u * c2 / 3.0))));
            }
            double velocity = std::max(std::abs(v0), std::abs(v1));
            for (const double u : kLooks) {
                velocity =
                    std::max(velocity, std::abs(v0 + u * (a0 + u * (c0 / 2.0 + u * (c1 / 6.0 + u * c2 / 12.0)))));
            }
            velocity += jerk * (kLooks[0] * kLooks[0] / 8.0);
            most.velocity = std::max(most.velocity, velocity / dt / limits.velocity[i]);
            most.acceleration = std::max(most.acceleration, acceleration / (dt * dt) / limits.acceleration[i]);
            most.jerk = std::max(most.jerk, jerk / (dt * dt * dt) / limits.jerk[i]);
        }
    }
    return most;
}

}  // namespace gemelo
