// A shorter way through the same free space: straight cuts between two places of it, at random and from corner to
// corner.
#pragma once

#include "search.h"

namespace gemelo {

class Shortener {
  public:
    Shortener(const Space& space, Rake& rake, Random& random, const Stop& stop)
        : space_(space), rake_(rake), random_(random), stop_(stop) {}

    // `patience`: cuts in a row that may fail before it is enough.
    std::vector<Joints> shorten(std::vector<Joints> way, int patience) {
        drop_corners(way);
        for (int failures = 0; way.size() > 2 && failures < patience && !stop_();) {
            failures = cut(way) ? 0 : failures + 1;
        }
        drop_corners(way);
        return way;
    }

    double length(const std::vector<Joints>& way) const {
        double sum = 0.0;
        for (size_t i = 1; i < way.size(); ++i) sum += space_.distance(way[i - 1].data(), way[i].data());
        return sum;
    }

  private:
    // From every corner straight to the farthest one that can be seen.
    void drop_corners(std::vector<Joints>& way) {
        for (size_t from = 0; from + 2 < way.size(); ++from) {
            for (size_t to = way.size() - 1; to > from + 1; --to) {
                if (stop_()) return;
                if (!rake_.is_free_line(way[from].data(), way[to].data(), stop_)) continue;
                way.erase(way.begin() + static_cast<long>(from) + 1, way.begin() + static_cast<long>(to));
                break;
            }
        }
    }

    bool cut(std::vector<Joints>& way) {
        const size_t edges = way.size() - 1;
        size_t first = random_.below(edges), second = random_.below(edges);
        const double here = random_.share(), there = random_.share();
        if (first == second) return false;
        if (first > second) std::swap(first, second);
        const Joints a = between(way[first], way[first + 1], here), b = between(way[second], way[second + 1], there);
        double old = space_.distance(a.data(), way[first + 1].data()) + space_.distance(way[second].data(), b.data());
        for (size_t i = first + 1; i < second; ++i) old += space_.distance(way[i].data(), way[i + 1].data());
        if (space_.distance(a.data(), b.data()) > 0.999 * old) return false;
        if (!rake_.is_free_line(a.data(), b.data(), stop_)) return false;
        std::vector<Joints> cut_way(way.begin(), way.begin() + static_cast<long>(first) + 1);
        cut_way.push_back(a);
        cut_way.push_back(b);
        cut_way.insert(cut_way.end(), way.begin() + static_cast<long>(second) + 1, way.end());
        way = std::move(cut_way);
        return true;
    }

    static Joints between(const Joints& a, const Joints& b, double share) {
        Joints result(a.size());
        for (size_t i = 0; i < a.size(); ++i) result[i] = a[i] + share * (b[i] - a[i]);
        return result;
    }

    const Space& space_;
    Rake& rake_;
    Random& random_;
    const Stop& stop_;
};

}  // namespace gemelo
