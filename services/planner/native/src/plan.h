// A plan: searches, each shortened, and the shortest path smoothed, within the same time and until the same flag.
#pragma once

#include "shorten.h"
#include "smooth.h"

namespace gemelo {

enum class Outcome { kFound, kStartTouches, kGoalTouches, kTimedOut, kCancelled };

struct Plan {
    Outcome outcome = Outcome::kTimedOut;
    std::vector<Joints> path;     // corners of the polyline, start and goal included
    std::vector<double> control;  // of the B-spline, by rows
    std::vector<double> shares;   // of its edges, how far each corner is cut; 0 at both ends
    double search_s = 0.0, shorten_s = 0.0, smooth_s = 0.0;
    uint64_t iterations = 0, checks = 0;
};

struct PlanQuery {
    Joints start;
    std::vector<Joints> goals;  // any of them will do
    uint64_t seed = 0;
    uint64_t enough = 0;             // configurations to check at most before no other search is begun; 0: one search
    bool are_lines_blocked = false;  // known of the straight lines from the start to all goals
    int patience = 6;                // of the shortener; measured
};

constexpr double kMuchLonger = 0.5;      // more than the least possible length: all of `enough` is spent; measured
constexpr uint64_t kNextSeed = 1000003;  // from search to search; chosen: a prime, far from the seeds of other requests

// Chosen: how finely lines are told apart [m]: a line that comes so near to something is no loss where there is room.
// What is shortened keeps clear by more than what is searched for: it is then smoothed and verified in fewer checks.
constexpr double kFinestSearched = 1e-3, kFinestShortened = 6e-3;
constexpr double kRoom = 1.2;  // times that, beyond the margin, which start and goals need; chosen

// True if the start and all goals are free, and have room for lines that are told apart to `finest` [m].
inline bool have_room(double finest, const World& world, const Kernel& kernel, const PlanQuery& query,
                      const Tolerances& tolerances) {
    Tolerances wide = tolerances;
    wide.margin += kRoom * finest;
    std::vector<const double*> ends = {query.start.data()};
    for (const Joints& goal : query.goals) ends.push_back(goal.data());
    return MotionValidator(world, kernel, wide).are_free(ends);
}

// How many configurations are to be checked, as much of `enough` as there is to be gained: nothing where a path is of
// the length `bound`, which none can be shorter than.
inline uint64_t worth_checking(uint64_t enough, double length, double bound) {
    const double most = kMuchLonger * bound, gain = std::min(length - bound, most);
    return gain > 0.0 ? static_cast<uint64_t>(static_cast<double>(enough) * gain / most) : 0;
}

// The shortest path of several searches into `result`; none where the first one was stopped. The others only look where
// a shorter path may lead, and shorten what they find.
inline void find_shortest(const Space& space, MotionValidator& searching, MotionValidator& shortening,
                          const PlanQuery& query, const std::vector<Joints>& goals, const StopCondition& stop,
                          Plan& result) {
    double least = std::numeric_limits<double>::infinity(), bound = least;
    for (const Joints& goal : goals) bound = std::min(bound, space.distance(query.start.data(), goal.data()));
    for (uint64_t seed = query.seed;; seed = (seed + kNextSeed) % (uint64_t{1} << 32)) {
        Random random(seed);
        const double began = stop.elapsed();
        Search search(space, searching, random, stop);
        const uint64_t worth = worth_checking(query.enough, least, bound);
        const uint64_t most = worth - std::min(worth, shortening.checks());
        std::vector<Joints> path = result.path.empty() ? search.find(query.start, goals, query.are_lines_blocked)
                                                       : search.find_shorter(query.start, goals, least, most);
        const double found = stop.elapsed();
        result.search_s += found - began;
        result.iterations += search.iterations();
        if (path.empty()) return;
        Shortener shortener(space, shortening, random, stop);
        path = shortener.shorten(std::move(path), query.patience);
        const double length = shortener.length(path);
        result.shorten_s += stop.elapsed() - found;
        if (length < least) {
            least = length;
            result.path = std::move(path);
        }
        const uint64_t checks = searching.checks() + shortening.checks();
        if (checks >= worth_checking(query.enough, least, bound) || stop()) return;
    }
}

inline Plan plan(const World& world, const Kernel& kernel, const Space& space, const Tolerances& tolerances,
                 const PlanQuery& query, const StopCondition& stop) {
    Plan result;
    // The widest room is asked for first: mostly it is there, and the rest needs no question.
    const bool is_wide = have_room(kFinestShortened, world, kernel, query, tolerances);
    const bool is_roomy = is_wide || have_room(kFinestSearched, world, kernel, query, tolerances);
    Tolerances hasty = tolerances;
    if (is_roomy) hasty.finest = std::max(hasty.finest, kFinestSearched);
    Tolerances hastier = hasty;
    if (is_wide) hastier.finest = std::max(hastier.finest, kFinestShortened);
    MotionValidator searching(world, kernel, hasty), shortening(world, kernel, hastier),
        last(world, kernel, tolerances);
    for (MotionValidator* validator : {&searching, &shortening, &last}) validator->learn();
    std::vector<Joints> goals;
    for (const Joints& goal : query.goals) {
        if (is_roomy || searching.is_free(goal.data())) goals.push_back(goal);
    }
    if (!is_roomy && !searching.is_free(query.start.data())) {
        result.outcome = Outcome::kStartTouches;
        return result;
    }
    if (goals.empty()) {
        result.outcome = Outcome::kGoalTouches;
        return result;
    }
    find_shortest(space, searching, shortening, query, goals, stop, result);
    if (result.path.empty()) {
        result.outcome = stop.is_cancelled() ? Outcome::kCancelled : Outcome::kTimedOut;
        result.checks = searching.checks() + shortening.checks();
        return result;
    }
    Smoother smoother(last, stop);
    result.control = smoother.smooth(result.path);
    result.shares = smoother.shares();
    result.shares.front() = result.shares.back() = 0.0;
    result.smooth_s = stop.elapsed() - result.search_s - result.shorten_s;
    result.checks = searching.checks() + shortening.checks() + last.checks();
    result.outcome = stop.is_cancelled() ? Outcome::kCancelled : Outcome::kFound;
    return result;
}

}  // namespace gemelo
