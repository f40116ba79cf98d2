// Joint states by time along a path, jerk-limited: round its corners (`timed_path`), or with a stop at each of them
// (`stop_and_go`).
//
// The operations stand in the order of services/planner/timing (timing.py, profile.py).
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "peaks.h"
#include "time_law.h"

namespace gemelo {

// Adds what is on the straight line from `start` (dof,) by `direction` times `length`, from the time `began` [s] to the
// one that is returned, without both ends.
inline double add_line(const double* start, const double* direction, double length, const LimitsView& limits,
                       double began, States& states) {
    Bounds most{INFINITY, INFINITY, INFINITY};
    for (size_t i = 0; i < limits.dof; ++i) {
        const double share = std::abs(direction[i]);
        if (!(share > kNegligible * limits.velocity[i])) continue;
        most.speed = std::min(most.speed, limits.velocity[i] / share);
        most.acceleration = std::min(most.acceleration, limits.acceleration[i] / share);
        most.jerk = std::min(most.jerk, limits.jerk[i] / share);
    }
    const JerkLimited profile(length, 0.0, 0.0,
                              {kMargin * most.speed, kMargin * most.acceleration, kMargin * most.jerk});
    const double duration = profile.duration, spacing = std::max(kSpacing, duration / kMostPoints);
    const auto add = [&](double time) {
        if (!(time < duration - 0.5 * kShortest)) return;
        const auto along = profile.at(time);
        states.times.push_back(began + time);
        for (size_t i = 0; i < limits.dof; ++i) {
            states.positions.push_back(start[i] + along[0] * direction[i]);
            states.velocities.push_back(along[1] * direction[i]);
            states.accelerations.push_back(along[2] * direction[i]);
        }
    };
    double last = 0.0, change = 0.0;
    for (size_t index = 0; index <= profile.count; ++index) {
        const bool is_end = index == profile.count;
        change = is_end ? duration : change + profile.phases[index].duration;
        if (change - last < kShortest || (change < duration && duration - change < kShortest)) continue;
        const double parts = std::max(1.0, std::nearbyint((change - last) / spacing));
        for (double part = 1.0; part <= parts; part += 1.0) add(last + (change - last) * part / parts);
        last = change;
    }
    return began + duration;
}

// From corner to corner of the polyline (rows, dof), at rest at all of them; throws `NoProfile`.
inline States stop_and_go(const double* corners, size_t rows, const LimitsView& limits) {
    const size_t dof = limits.dof;
    States states;
    states.add_rest(0.0, corners, dof);
    double direction[kMaxDof];
    for (size_t row = 0; row + 1 < rows; ++row) {
        const double *start = corners + row * dof, *goal = start + dof, began = states.times.back();
        double length = 0.0, rise = 0.0;
        for (size_t i = 0; i < dof; ++i) {
            direction[i] = goal[i] - start[i];
            length = std::max(length, std::abs(direction[i]) / limits.velocity[i]);
            rise = std::max(rise, std::abs(direction[i]) / limits.acceleration[i]);
        }
        if (length < kStandstill) {
            states.add_rest(began + kHold, goal, dof);
            continue;
        }
        require_short(std::max(length, std::sqrt(rise)));
        for (size_t i = 0; i < dof; ++i) direction[i] /= length;
        states.add_rest(add_line(start, direction, length, limits, began, states), goal, dof);
    }
    return states;
}

// Joint states of a run at rest at both ends, told later by `clock` [s]; a first one at the same time as the last state
// is left out.
inline void add_run(const SplineRun& run, const LimitsView& limits, States& states) {
    const RunTimeLaw law(sections_of(run, limits));
    const double clock = states.times.empty() ? 0.0 : states.times.back();
    PathPoint point;
    for (const double time : law.times(run)) {
        if (!states.times.empty() && !(clock + time > states.times.back())) continue;
        const auto [length, speed, bend] = law.at(time);
        run.at(length, point);
        states.times.push_back(clock + time);
        for (size_t i = 0; i < run.dof(); ++i) {
            const double first = point.first[i], scale = limits.velocity[i];
            states.positions.push_back(point.value[i] * scale);
            states.velocities.push_back(first * speed * scale);
            states.accelerations.push_back((point.second[i] * (speed * speed) + first * bend) * scale);
        }
    }
}

// The same path in the time in which the joint that is asked most of is just within its limits.
inline void bring_to_limits(const LimitsView& limits, States& states) {
    const PeakShares peaks = peak_shares(states, limits);
    const double most = std::max(std::max(peaks.velocity, std::sqrt(peaks.acceleration)), std::cbrt(peaks.jerk));
    if (most == 0.0) return;
    const double scale = kMargin / most;
    for (double& time : states.times) time /= scale;
    for (double& velocity : states.velocities) velocity *= scale;
    for (double& acceleration : states.accelerations) acceleration *= scale * scale;
}

// From rest to rest along the uniform cubic B-spline of `control` (rows, dof), rows >= 4, both ends exact; at corners
// it stops. Throws `NoProfile`, and `TurnsOnTheSpot` where the curve does so without a corner.
inline States timed_path(const double* control, size_t rows, const LimitsView& limits) {
    const size_t dof = limits.dof;
    double lasts = 0.0;
    for (size_t row = 0; row + 1 < rows; ++row) {
        double slowest = 0.0;
        for (size_t i = 0; i < dof; ++i) {
            const double step = std::abs(control[(row + 1) * dof + i] - control[row * dof + i]);
            slowest = std::max(slowest, step / limits.velocity[i]);
        }
        lasts += slowest;
    }
    require_short(lasts);
    const double* goal = control + (rows - 1) * dof;
    States states;
    states.reserve(static_cast<size_t>(kMostPoints), dof);
    for (const SplineRun& run : smooth_runs(control, rows, limits)) add_run(run, limits, states);
    if (states.times.empty()) {
        std::vector<double> ends(control, control + dof);
        ends.insert(ends.end(), goal, goal + dof);
        return stop_and_go(ends.data(), 2, limits);
    }
    const size_t last = (states.times.size() - 1) * dof;
    std::copy(control, control + dof, states.positions.begin());
    std::copy(goal, goal + dof, states.positions.begin() + static_cast<std::ptrdiff_t>(last));
    for (auto* column : {&states.velocities, &states.accelerations}) {
        std::fill_n(column->begin(), dof, 0.0);
        std::fill_n(column->begin() + static_cast<std::ptrdiff_t>(last), dof, 0.0);
    }
    bring_to_limits(limits, states);
    require_short(states.times.back());
    return states;
}

}  // namespace gemelo
