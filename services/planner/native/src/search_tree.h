// A tree of a search: its configurations, and which of them is nearest to another one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "joint_path.h"

namespace gemelo {

struct Space {
    Joints lower, upper;
    Joints weights;  // [1/rad] or [1/m]: what a unit of each joint costs; distances are weighted Euclidean

    double distance(const double* a, const double* b) const {
        double sum = 0.0;
        for (size_t i = 0; i < weights.size(); ++i) {
            const double path = weights[i] * (a[i] - b[i]);
            sum += path * path;
        }
        return std::sqrt(sum);
    }
};

// Configurations, from which one each was reached, and whether something is known to be in the way there.
class SearchTree {
  public:
    explicit SearchTree(const Space& space) : space_(space), dof_(space.lower.size()) {}

    size_t size() const { return parents_.size(); }
    const double* row(size_t index) const { return rows_.data() + index * dof_; }

    size_t add(const double* joints, size_t parent) {
        const Joints copy(joints, joints + dof_);  // `joints` may be a row of this very tree
        const size_t lane = size() % kLanes;
        if (lane == 0) blocks_.resize(blocks_.size() + dof_ * kLanes, std::numeric_limits<float>::infinity());
        float* block = blocks_.data() + blocks_.size() - dof_ * kLanes;
        for (size_t i = 0; i < dof_; ++i) block[i * kLanes + lane] = weighted(copy.data(), i);
        rows_.insert(rows_.end(), copy.begin(), copy.end());
        parents_.push_back(parent);
        blocked_.push_back(0);
        return parents_.size() - 1;
    }

    bool is_blocked(size_t index) const { return blocked_[index] != 0; }
    void block(size_t index) { blocked_[index] = 1; }

    struct Nearest {
        size_t index;
        float squared;  // of its distance
    };

    // The first of the nearest ones, as floats tell them apart: eight at once, in two vectors of four, which every
    // 64-bit processor has.
    Nearest nearest(const double* joints) const {
        float at[kMaxDof];
        for (size_t i = 0; i < dof_; ++i) at[i] = weighted(joints, i);
        const float infinite = std::numeric_limits<float>::infinity();
        Floats least[2] = {Floats{} + infinite, Floats{} + infinite};
        Integers places[2] = {};
        const float* column = blocks_.data();
        const int32_t count = static_cast<int32_t>((size() + kLanes - 1) / kLanes);
        for (int32_t place = 0; place < count; ++place) {
            Floats sums[2] = {};
            for (size_t i = 0; i < dof_; ++i, column += kLanes) {
                for (size_t half = 0; half < 2; ++half) {
                    Floats path;
                    std::memcpy(&path, column + half * kFour, sizeof path);
                    path -= at[i];
                    sums[half] += path * path;
                }
            }
            for (size_t half = 0; half < 2; ++half) {
                const Integers is_less = sums[half] < least[half];
                places[half] = is_less ? Integers{} + place : places[half];
                least[half] = is_less ? sums[half] : least[half];
            }
        }
        return first_of(least, places);
    }

    // From `index` to its root.
    std::vector<Joints> path_to_root(size_t index) const {
        std::vector<Joints> path;
        for (;; index = parents_[index]) {
            path.emplace_back(row(index), row(index) + dof_);
            if (parents_[index] == index) return path;
        }
    }

  private:
    typedef float Floats __attribute__((vector_size(16)));
    typedef int32_t Integers __attribute__((vector_size(16)));
    static constexpr size_t kFour = 4;

    float weighted(const double* joints, size_t i) const { return static_cast<float>(space_.weights[i] * joints[i]); }

    // Of the least of each lane the first one in the order of the nodes.
    static Nearest first_of(const Floats (&least)[2], const Integers (&places)[2]) {
        Nearest best{0, std::numeric_limits<float>::infinity()};
        for (size_t lane = 0; lane < kLanes; ++lane) {
            const float here = least[lane / kFour][lane % kFour];
            const size_t index = static_cast<size_t>(places[lane / kFour][lane % kFour]) * kLanes + lane;
            if (here < best.squared || (here == best.squared && index < best.index)) best = {index, here};
        }
        return best;
    }

    const Space& space_;
    size_t dof_;
    std::vector<double> rows_;
    std::vector<float> blocks_;  // the same by eights, each joint's side by side, as distances count them
    std::vector<size_t> parents_;
    std::vector<uint8_t> blocked_;
};

}  // namespace gemelo
