// Data of the timing, in doubles: limits of the joints, rows of joint states, and the reasons for none.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

namespace gemelo {

// No jerk-limited profile, or one that no plan may take; the text says why.
struct NoProfile : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// The curve comes to rest in its parameter where it has no corner.
struct TurnsOnTheSpot : std::runtime_error {
    using std::runtime_error::runtime_error;
};

// (dof,) each: [rad/s] or [m/s], and their derivatives.
struct LimitsView {
    const double *velocity, *acceleration, *jerk;
    size_t dof;
};

// Rows (m, n) in [rad] or [m] and their derivatives, at `times` (m,) [s].
struct States {
    std::vector<double> times, positions, velocities, accelerations;

    void reserve(size_t rows, size_t dof) {
        times.reserve(rows);
        for (auto* column : {&positions, &velocities, &accelerations}) column->reserve(rows * dof);
    }
    void add_rest(double time, const double* row, size_t dof) {
        times.push_back(time);
        positions.insert(positions.end(), row, row + dof);
        velocities.insert(velocities.end(), dof, 0.0);
        accelerations.insert(accelerations.end(), dof, 0.0);
    }
};

// Tuning constants, chosen as in services/planner/timing (profile.py), which computes the same where this is not built.
constexpr double kSpacing = 0.05;  // [s] between points, where the profile does not change its jerk
constexpr double kMostPoints = 400.0;
constexpr double kShortest = 1e-4;     // [s] two points of a line nearer than that are one
constexpr double kMargin = 0.997;      // share of the limits that is used
constexpr double kLongest = 86400.0;   // [s] a plan may take
constexpr double kStandstill = 1e-9;   // [s] at full speed: a path so short is no way
constexpr double kNegligible = 1e-12;  // share of its full speed below which a joint limits nothing
constexpr double kHold = 0.1;          // [s] that a plan to where the arm already is takes

// Throws `NoProfile` for a path that takes at least so long [s].
inline void require_short(double lasts) {
    if (lasts <= kLongest) return;
    char text[96];
    std::snprintf(text, sizeof text, "it would take more than %.3g s, %g s is the most", lasts, kLongest);
    throw NoProfile(text);
}

}  // namespace gemelo
