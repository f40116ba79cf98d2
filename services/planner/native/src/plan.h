// A plan: search, shorten, smooth, each within the same time and until the same flag.
#pragma once

#include "shorten.h"
#include "smooth.h"

namespace gemelo {

enum class Outcome { kFound, kStartTouches, kGoalTouches, kTimedOut, kCancelled };

struct Plan {
    Outcome outcome = Outcome::kTimedOut;
    std::vector<Joints> path;     // corners of the polyline, start and goal included
    std::vector<double> control;  // of the B-spline, by rows
    double search_s = 0.0, shorten_s = 0.0, smooth_s = 0.0;
    uint64_t iterations = 0, checks = 0;
};

struct PlanQuery {
    Joints start;
    std::vector<Joints> goals;  // any of them will do
    uint64_t seed = 0;
    int patience = 30;  // of the shortener
};

// How finely lines are told apart while searching: a line that comes so near to something is no loss, unless the start
// or a goal is as near itself.
inline Tolerances while_searching(const World& world, const Kernel& kernel, const Tolerances& tolerances,
                                  const PlanQuery& query) {
    Tolerances hasty = tolerances;
    hasty.finest = std::max(tolerances.finest, 1e-3);
    Tolerances wide = tolerances;
    wide.margin += 2.0 * hasty.finest;
    MotionValidator validator(world, kernel, wide);
    bool has_room = validator.is_free(query.start.data());
    for (const Joints& goal : query.goals) has_room = has_room && validator.is_free(goal.data());
    return has_room ? hasty : tolerances;
}

inline Plan plan(const World& world, const Kernel& kernel, const Space& space, const Tolerances& tolerances,
                 const PlanQuery& query, const StopCondition& stop) {
    Plan result;
    MotionValidator validator(world, kernel, while_searching(world, kernel, tolerances, query));
    MotionValidator last(world, kernel, tolerances);
    Random random(query.seed);
    std::vector<Joints> goals;
    for (const Joints& goal : query.goals) {
        if (validator.is_free(goal.data())) goals.push_back(goal);
    }
    if (!validator.is_free(query.start.data())) {
        result.outcome = Outcome::kStartTouches;
        return result;
    }
    if (goals.empty()) {
        result.outcome = Outcome::kGoalTouches;
        return result;
    }
    Search search(space, validator, random, stop);
    result.path = search.find(query.start, goals);
    result.search_s = stop.elapsed();
    result.iterations = search.iterations();
    if (result.path.empty()) {
        result.outcome = stop.is_cancelled() ? Outcome::kCancelled : Outcome::kTimedOut;
        result.checks = validator.checks();
        return result;
    }
    result.path = Shortener(space, validator, random, stop).shorten(std::move(result.path), query.patience);
    result.shorten_s = stop.elapsed() - result.search_s;
    result.control = Smoother(last, stop).smooth(result.path);
    result.smooth_s = stop.elapsed() - result.search_s - result.shorten_s;
    result.checks = validator.checks() + last.checks();
    result.outcome = stop.is_cancelled() ? Outcome::kCancelled : Outcome::kFound;
    return result;
}

}  // namespace gemelo
