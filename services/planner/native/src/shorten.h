// A shorter path through the same free space: straight cuts between two places of it, at random and from corner to
// corner, and corners pulled towards the line between their neighbours, all joints together and one by one (Geraerts
// and Overmars 2007).
#pragma once

#include "search.h"

namespace gemelo {

class Shortener {
  public:
    Shortener(const Space& space, MotionValidator& validator, Random& random, const StopCondition& stop)
        : space_(space), validator_(validator), random_(random), stop_(stop) {}

    // `patience`: cuts in a row that may fail before it is enough.
    std::vector<Joints> shorten(std::vector<Joints> path, int patience) {
        drop_corners(path);
        for (int failures = 0; path.size() > 2 && failures < patience && !stop_();) {
            failures = cut(path) ? 0 : failures + 1;
        }
        drop_corners(path);
        for (int round = 0; round < kRounds && path.size() > 2 && !stop_(); ++round) {
            const double before = length(path);
            for (size_t corner = 1; corner + 1 < path.size(); ++corner) pull(path, corner);
            drop_corners(path);
            if (length(path) > kWorthARound * before) break;
        }
        return path;
    }

    double length(const std::vector<Joints>& path) const {
        double sum = 0.0;
        for (size_t i = 1; i < path.size(); ++i) sum += space_.distance(path[i - 1].data(), path[i].data());
        return sum;
    }

  private:
    // Measured: more of either made the paths of drawn problems shorter by less than 1 %.
    static constexpr int kRounds = 3;
    static constexpr double kWorthARound = 0.99;  // of the length before, or it is the last one
    static constexpr double kWorthAMove = 0.995;  // of the length of both edges before

    void pull(std::vector<Joints>& path, size_t corner) {
        for (const double share : {0.5, 0.25}) {
            while (!stop_() && move(path, corner, between(path[corner], foot(path, corner), share))) continue;
        }
        const Joints there = foot(path, corner);
        for (size_t i = 0; i < there.size() && !stop_(); ++i) {
            Joints at = path[corner];
            at[i] = there[i];
            move(path, corner, at);
        }
    }

    // The corner to `at`, where that is free and worth it.
    bool move(std::vector<Joints>& path, size_t corner, const Joints& at) {
        const double *before = path[corner - 1].data(), *after = path[corner + 1].data(), *old = path[corner].data();
        const double length = space_.distance(before, old) + space_.distance(old, after);
        if (space_.distance(before, at.data()) + space_.distance(at.data(), after) > kWorthAMove * length) return false;
        if (!validator_.is_free_corner(before, at.data(), after, stop_)) return false;
        path[corner] = at;
        return true;
    }

    // The place nearest to the corner on the line between its neighbours.
    Joints foot(const std::vector<Joints>& path, size_t corner) const {
        const Joints &from = path[corner - 1], &to = path[corner + 1], &here = path[corner];
        double along = 0.0, squared = 0.0;
        for (size_t i = 0; i < from.size(); ++i) {
            const double weight = space_.weights[i] * space_.weights[i], way = to[i] - from[i];
            along += weight * (here[i] - from[i]) * way;
            squared += weight * way * way;
        }
        return between(from, to, squared > 0.0 ? std::min(1.0, std::max(0.0, along / squared)) : 0.0);
    }

    // From every corner straight to the farthest one that can be seen.
    void drop_corners(std::vector<Joints>& path) {
        for (size_t from = 0; from + 2 < path.size(); ++from) {
            for (size_t to = path.size() - 1; to > from + 1; --to) {
                if (stop_()) return;
                if (!validator_.is_free_line(path[from].data(), path[to].data(), stop_)) continue;
                path.erase(path.begin() + static_cast<long>(from) + 1, path.begin() + static_cast<long>(to));
                break;
            }
        }
    }

    bool cut(std::vector<Joints>& path) {
        const size_t edges = path.size() - 1;
        size_t first = random_.below(edges), second = random_.below(edges);
        const double here = random_.share(), there = random_.share();
        if (first == second) return false;
        if (first > second) std::swap(first, second);
        const Joints a = between(path[first], path[first + 1], here),
                     b = between(path[second], path[second + 1], there);
        double old = space_.distance(a.data(), path[first + 1].data()) + space_.distance(path[second].data(), b.data());
        for (size_t i = first + 1; i < second; ++i) old += space_.distance(path[i].data(), path[i + 1].data());
        if (space_.distance(a.data(), b.data()) > 0.999 * old) return false;
        if (!validator_.is_free_line(a.data(), b.data(), stop_)) return false;
        std::vector<Joints> cut_way(path.begin(), path.begin() + static_cast<long>(first) + 1);
        cut_way.push_back(a);
        cut_way.push_back(b);
        cut_way.insert(cut_way.end(), path.begin() + static_cast<long>(second) + 1, path.end());
        path = std::move(cut_way);
        return true;
    }

    static Joints between(const Joints& a, const Joints& b, double share) {
        Joints result(a.size());
        for (size_t i = 0; i < a.size(); ++i) result[i] = a[i] + share * (b[i] - a[i]);
        return result;
    }

    const Space& space_;
    MotionValidator& validator_;
    Random& random_;
    const StopCondition& stop_;
};

}  // namespace gemelo
