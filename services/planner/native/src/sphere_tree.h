// Spheres around spheres: a binary tree, depth first, in which a node's `skip` is the first one that is not inside it.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "views.h"

namespace gemelo {

struct Sphere {
    double x, y, z, radius;
};

// At least `value`, as a float.
inline float rounded_up(double value) {
    return std::nextafter(static_cast<float>(value), std::numeric_limits<float>::infinity());
}

// The same of what is not negative, quickly, and up to a millionth more.
inline float raised(double value) { return static_cast<float>(1.000001 * value); }

class SphereTree {
  public:
    // `steps` of making the sphere around several smaller.
    explicit SphereTree(const std::vector<Sphere>& spheres, int steps = 64)
        : spheres_(spheres), order_(spheres.size()), steps_(steps) {
        std::iota(order_.begin(), order_.end(), 0);
        nodes_.reserve(2 * spheres.size());
        if (!spheres.empty()) add(0, spheres.size());
    }

    std::vector<NodeView> take() { return std::move(nodes_); }

  private:
    void add(size_t begin, size_t end) {
        const size_t self = nodes_.size();
        const bool is_leaf = end - begin == 1;
        const Sphere sphere = is_leaf ? spheres_[static_cast<size_t>(order_[begin])] : around(begin, end);
        nodes_.push_back({static_cast<float>(sphere.x), static_cast<float>(sphere.y), static_cast<float>(sphere.z),
                          rounded_up(sphere.radius), 0, is_leaf ? order_[begin] : -1});
        if (!is_leaf) {
            const size_t middle = split(begin, end);
            add(begin, middle);
            add(middle, end);
        }
        nodes_[self].skip = static_cast<int32_t>(nodes_.size());
    }

    // Badoiu and Clarkson (2003): towards the farthest one by ever smaller steps; then what that centre needs.
    Sphere around(size_t begin, size_t end) const {
        Sphere best = spheres_[static_cast<size_t>(order_[begin])];
        for (int step = 1; step <= steps_; ++step) {
            const Sphere& far = *farthest(best, begin, end).sphere;
            const double share = 1.0 / (step + 1);
            best.x += share * (far.x - best.x);
            best.y += share * (far.y - best.y);
            best.z += share * (far.z - best.z);
        }
        best.radius = farthest(best, begin, end).reach + 1e-6;
        return best;
    }

    struct Farthest {
        const Sphere* sphere;
        double reach;  // to its far side
    };

    Farthest farthest(const Sphere& from, size_t begin, size_t end) const {
        Farthest found{&spheres_[static_cast<size_t>(order_[begin])], -1.0};
        for (size_t i = begin; i < end; ++i) {
            const Sphere& to = spheres_[static_cast<size_t>(order_[i])];
            const double x = to.x - from.x, y = to.y - from.y, z = to.z - from.z;
            const double reach = std::sqrt(x * x + y * y + z * z) + to.radius;
            if (reach > found.reach) found = {&to, reach};
        }
        return found;
    }

    // At the median along the axis in which the centres are spread the most.
    size_t split(size_t begin, size_t end) {
        static constexpr double Sphere::* kAxes[] = {&Sphere::x, &Sphere::y, &Sphere::z};
        double widest = -1.0;
        double Sphere::* axis = &Sphere::x;
        for (double Sphere::* each : kAxes) {
            double low = std::numeric_limits<double>::infinity(), high = -low;
            for (size_t i = begin; i < end; ++i) {
                low = std::min(low, spheres_[static_cast<size_t>(order_[i])].*each);
                high = std::max(high, spheres_[static_cast<size_t>(order_[i])].*each);
            }
            if (high - low > widest) {
                widest = high - low;
                axis = each;
            }
        }
        std::stable_sort(order_.begin() + static_cast<long>(begin), order_.begin() + static_cast<long>(end),
                         [&](int32_t a, int32_t b) {
                             return spheres_[static_cast<size_t>(a)].*axis < spheres_[static_cast<size_t>(b)].*axis;
                         });
        return begin + (end - begin) / 2;
    }

    const std::vector<Sphere>& spheres_;
    std::vector<int32_t> order_;
    int steps_;
    std::vector<NodeView> nodes_;
};

}  // namespace gemelo
