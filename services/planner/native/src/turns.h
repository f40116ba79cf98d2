// Closed-form solutions within the limits, with every full turn, and configurations by how soon they are reached.
#pragma once

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace gemelo {

// Of one arm, (dof,) each [rad] or [m]; a joint stands as before after its `period`, which is a full turn where it
// turns.
struct RangesView {
    const double *lower, *upper, *period;
    size_t dof;
};

// So many full turns of each joint that there are at most `most` choices, fewer of those with the most.
inline void bound_turns(std::vector<double>& turns, double most) {
    const auto choices = [&] {
        return std::accumulate(turns.begin(), turns.end(), 1.0,
                               [](double so_far, double n) { return so_far * (n + 1); });
    };
    while (choices() > most) {
        const double fewer = *std::max_element(turns.begin(), turns.end()) - 1.0;
        for (double& each : turns) each = std::min(each, fewer);
    }
}

// Appends `branch` (dof,) to `rows` with each choice of full turns within the limits, the last joint's first; nothing
// where one joint has none, or is no number.
inline void append_turns(const RangesView& ranges, const double* branch, double turn, double most,
                         std::vector<double>& rows) {
    std::vector<double> first(ranges.dof), turns(ranges.dof), chosen(ranges.dof, 0.0);
    for (size_t i = 0; i < ranges.dof; ++i) {
        const double period = ranges.period[i];
        first[i] = branch[i] + period * std::ceil((ranges.lower[i] - branch[i]) / period);
        turns[i] = std::floor((ranges.upper[i] - first[i]) / period);
        if (!(turns[i] >= 0.0)) return;
    }
    bound_turns(turns, most);
    for (size_t joint = ranges.dof; joint != 0;) {
        for (size_t i = 0; i < ranges.dof; ++i) rows.push_back(first[i] + turn * chosen[i]);
        for (joint = ranges.dof; joint != 0 && chosen[joint - 1] == turns[joint - 1]; --joint) chosen[joint - 1] = 0.0;
        if (joint != 0) chosen[joint - 1] += 1.0;
    }
}

// The numbers of `rows` (count, dof), those first that the slowest joint reaches soonest from `near` (dof,).
inline std::vector<size_t> by_travel(const double* rows, size_t count, const double* near, const double* speed,
                                     size_t dof) {
    std::vector<double> travel(count, 0.0);
    for (size_t row = 0; row < count; ++row) {
        for (size_t i = 0; i < dof; ++i) {
            travel[row] = std::max(travel[row], std::abs(rows[row * dof + i] - near[i]) / speed[i]);
        }
    }
    std::vector<size_t> order(count);
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return travel[a] < travel[b]; });
    return order;
}

}  // namespace gemelo
