// A shorter path through the same free space: straight cuts between two places of it, at random and from corner to
// corner.
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
        return path;
    }

    double length(const std::vector<Joints>& path) const {
        double sum = 0.0;
        for (size_t i = 1; i < path.size(); ++i) sum += space_.distance(path[i - 1].data(), path[i].data());
        return sum;
    }

  private:
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
