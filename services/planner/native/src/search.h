// RRT-Connect (Kuffner and LaValle 2000): two trees that grow towards one another, from the start and from the goals.
// Where a node could not be left, it is only asked about what is near it (dynamic domain; Yershova et al. 2005).
#pragma once

#include "motion_validator.h"
#include "random.h"
#include "search_tree.h"

namespace gemelo {

class Search {
  public:
    Search(const Space& space, MotionValidator& validator, Random& random, const StopCondition& stop)
        : space_(space), validator_(validator), random_(random), stop_(stop) {
        diagonal_ = space_.distance(space_.lower.data(), space_.upper.data());
        range_ = kRange * diagonal_;
    }

    size_t iterations() const { return iterations_; }

    // A path from `start` to one of `goals`, all of which must be free; none when it was stopped. The straight lines
    // are not looked at where none is known to be free.
    std::vector<Joints> find(const Joints& start, const std::vector<Joints>& goals, bool are_lines_blocked) {
        for (const Joints& goal : goals) {
            if (!are_lines_blocked && validator_.is_free_line(start.data(), goal.data(), stop_)) return {start, goal};
        }
        const double everything = std::numeric_limits<double>::infinity();
        nearest_ = everything;
        for (const Joints& goal : goals) nearest_ = std::min(nearest_, space_.distance(start.data(), goal.data()));
        return grown(start, goals, everything, std::numeric_limits<uint64_t>::max());
    }

    // As `find`, where none of the goals can be seen from the start: only configurations are drawn by which a path
    // shorter than `longest` may lead (Gammell et al. 2014); none too once so many configurations have been checked.
    std::vector<Joints> find_shorter(const Joints& start, const std::vector<Joints>& goals, double longest,
                                     uint64_t most_checks) {
        return grown(start, goals, longest, most_checks);
    }

  private:
    std::vector<Joints> grown(const Joints& start, const std::vector<Joints>& goals, double longest,
                              uint64_t most_checks) {
        SearchTree from_start(space_), from_goals(space_);
        from_start.add(start.data(), 0);
        for (const Joints& goal : goals) from_goals.add(goal.data(), from_goals.size());
        const float domain = static_cast<float>(kDomain * diagonal_ * kDomain * diagonal_);
        SearchTree *grows = &from_start, *meets = &from_goals;
        Joints sample(start.size());
        for (iterations_ = 1; validator_.checks() < most_checks && !is_over(); ++iterations_) {
            if (!draw(start, goals, longest, sample)) break;
            const SearchTree::Nearest from = grows->nearest(sample.data());
            if (from.squared > domain && grows->is_blocked(from.index)) continue;
            const size_t before = grows->size();
            extend(*grows, from.index, sample.data());
            if (grows->size() == before) grows->block(from.index);
            if (grows->size() > before && connect(*grows, *meets)) {
                const bool is_turned = grows == &from_goals;
                return is_turned ? joined(*meets, *grows) : joined(*grows, *meets);
            }
            if (grows->size() > meets->size()) std::swap(grows, meets);
        }
        return {};
    }

    // The checks ask too: most samples are dropped, in less time than the question takes.
    bool is_over() const { return iterations_ % kAsked == 0 && stop_(); }

    // Somewhere between the bounds, by which a path shorter than `longest` may lead; false where so many draws have
    // found nothing. Where no path is known, short ones are looked for first: the longer the search lasts, the farther
    // away is drawn.
    bool draw(const Joints& start, const std::vector<Joints>& goals, double longest, Joints& sample) {
        if (!std::isinf(longest)) return draw_within(start, goals, longest, kMostDraws, sample);
        const double reach =
            kNear * nearest_ + kWider * diagonal_ * std::pow(kGrowth, static_cast<double>(iterations_));
        if (reach < diagonal_ && draw_within(start, goals, reach, kFewDraws, sample)) return true;
        for (size_t i = 0; i < sample.size(); ++i) {
            sample[i] = space_.lower[i] + random_.share() * (space_.upper[i] - space_.lower[i]);
        }
        return true;
    }

    bool draw_within(const Joints& start, const std::vector<Joints>& goals, double longest, int draws, Joints& sample) {
        for (int drawn = 0; drawn < draws; ++drawn) {
            if (draw_around(start, goals[random_.below(goals.size())], longest, sample)) return true;
        }
        return false;
    }

    // Evenly in the ellipsoid around both of all that is no farther than `longest` from them together: a ball,
    // stretched along the first axis and mirrored so that this lies between them. False where there is none, or beyond
    // the bounds.
    bool draw_around(const Joints& start, const Joints& goal, double longest, Joints& sample) {
        const size_t dof = sample.size();
        const double distance = space_.distance(start.data(), goal.data());
        if (!(distance < longest) || distance < 1e-9) return false;
        double length = 0.0, mirror[kMaxDof], along = 0.0, mirrored = 0.0;
        for (size_t i = 0; i < dof; ++i) {
            sample[i] = random_.normal();
            length += sample[i] * sample[i];
        }
        const double radius = std::pow(random_.share(), 1.0 / static_cast<double>(dof)) / std::sqrt(length);
        const double wide = 0.5 * std::sqrt(longest * longest - distance * distance);
        for (size_t i = 0; i < dof; ++i) {
            sample[i] *= radius * (i == 0 ? 0.5 * longest : wide);
            mirror[i] = (i == 0 ? 1.0 : 0.0) - space_.weights[i] * (goal[i] - start[i]) / distance;
            mirrored += mirror[i] * mirror[i];
            along += mirror[i] * sample[i];
        }
        const double share = mirrored > 1e-12 ? 2.0 * along / mirrored : 0.0;
        for (size_t i = 0; i < dof; ++i) {
            sample[i] = 0.5 * (start[i] + goal[i]) + (sample[i] - share * mirror[i]) / space_.weights[i];
            if (!(sample[i] >= space_.lower[i] && sample[i] <= space_.upper[i])) return false;
        }
        return true;
    }

    static constexpr int kMostDraws = 200;  // chosen: bounds the time where hardly anything is free
    static constexpr int kFewDraws = 8;     // chosen, of those for short paths
    // Measured: how long the paths are that are looked for first, by the distance to the nearest goal and the diagonal
    // of all that the joints can do, and by how much longer with every sample.
    static constexpr double kNear = 1.1, kWider = 0.01, kGrowth = 1.01;
    // Measured, of the diagonal: how far a tree grows at once, and how far from a blocked node samples are taken.
    static constexpr double kRange = 0.08, kDomain = 0.2;
    static constexpr size_t kAsked = 8;  // chosen: from question to question, in samples

    // One step of at most `range_` from a node towards `target`; true when it got there.
    bool extend(SearchTree& tree, size_t from, const double* target) {
        const double distance = space_.distance(tree.row(from), target);
        const double share = std::min(1.0, range_ / std::max(distance, 1e-12));
        Joints next(tree.row(from), tree.row(from) + space_.lower.size());
        for (size_t i = 0; i < next.size(); ++i) {
            next[i] = share < 1.0 ? next[i] + share * (target[i] - next[i]) : target[i];
        }
        if (!validator_.is_free_line(tree.row(from), next.data(), stop_)) return false;
        tree.add(next.data(), from);
        return share >= 1.0;
    }

    // From the other tree towards the newest node of the one that grew, until there or blocked.
    bool connect(const SearchTree& grown, SearchTree& other) {
        const Joints target(grown.row(grown.size() - 1), grown.row(grown.size() - 1) + space_.lower.size());
        size_t from = other.nearest(target.data()).index;
        for (;;) {
            const size_t before = other.size();
            if (extend(other, from, target.data())) return true;
            if (other.size() == before) return false;
            from = other.size() - 1;
        }
    }

    // The newest nodes of both are the same configuration.
    std::vector<Joints> joined(const SearchTree& from_start, const SearchTree& from_goals) const {
        std::vector<Joints> path = from_start.path_to_root(from_start.size() - 1);
        std::reverse(path.begin(), path.end());
        const std::vector<Joints> rest = from_goals.path_to_root(from_goals.size() - 1);
        path.insert(path.end(), rest.begin() + 1, rest.end());
        return path;
    }

    const Space& space_;
    MotionValidator& validator_;
    Random& random_;
    const StopCondition& stop_;
    double diagonal_, range_;
    double nearest_ = 0.0;  // from the start to a goal
    size_t iterations_ = 0;
};

}  // namespace gemelo
