// A curve without corners in place of a polyline: the control points of a uniform cubic B-spline.
//
// Each corner keeps its own control point, with one before and one after it on its edges. The curve cuts the corner by
// a share of these edges; where that is not free the share is halved, and at last the corner is taken as it is: three
// equal control points, at which the curve comes to rest in its parameter.
#pragma once

#include "motion_validator.h"

namespace gemelo {

class Smoother {
  public:
    Smoother(MotionValidator& validator, const StopCondition& stop) : validator_(validator), stop_(stop) {}

    // Control points by rows; both ends are there three times. The whole curve is free where the polyline is.
    std::vector<double> smooth(const std::vector<Joints>& path) {
        shares_.assign(path.size(), 0.5);
        std::vector<bool> open(path.size(), true);
        for (bool is_done = false; !is_done && !stop_();) {
            is_done = true;
            lay(path);
            for (size_t corner = 1; corner + 1 < path.size(); ++corner) {
                if (!open[corner] || is_free(corner)) {
                    open[corner] = false;
                    continue;
                }
                shares_[corner] = shares_[corner] > kLeast ? 0.5 * shares_[corner] : 0.0;
                open[corner] = open[corner - 1] = open[corner + 1] = true;  // the neighbours share its edges
                is_done = false;
            }
        }
        if (stop_()) {
            shares_.assign(path.size(), 0.0);
            lay(path);
        }
        return points_;
    }

    // Of its edges, how far each corner of the last path is cut; 0 where the curve goes to the corner itself.
    const std::vector<double>& shares() const { return shares_; }

  private:
    // Chosen as in smoothing.py.
    static constexpr double kLeast = 1.0 / 64.0;
    static constexpr size_t kShared = 2;  // control points between two corners that share the one between them

    size_t count() const { return points_.size() / dof_; }

    void lay(const std::vector<Joints>& path) {
        dof_ = path[0].size();
        points_.clear();
        places_.assign(path.size(), 0);
        for (int i = 0; i < 3; ++i) push(path.front(), path.front(), 0.0);
        for (size_t corner = 1; corner + 1 < path.size(); ++corner) {
            const double share = shares_[corner];
            const bool is_sharp = share == 0.0;
            const bool is_shared = corner > 1 && share == 0.5 && shares_[corner - 1] == 0.5;
            if (is_sharp) push(path[corner], path[corner], 0.0);
            if (!is_sharp && !is_shared) push(path[corner], path[corner - 1], share);
            places_[corner] = count();
            push(path[corner], path[corner], 0.0);
            if (is_sharp) push(path[corner], path[corner], 0.0);
            if (!is_sharp) push(path[corner], path[corner + 1], share);
        }
        places_.back() = count();
        for (int i = 0; i < 3; ++i) push(path.back(), path.back(), 0.0);
    }

    void push(const Joints& from, const Joints& to, double share) {
        for (size_t i = 0; i < dof_; ++i) points_.push_back(from[i] + share * (to[i] - from[i]));
    }

    // The spans that bend at the corner; others that its control point has a part in lie on an edge of the polyline.
    bool is_free(size_t corner) {
        if (shares_[corner] == 0.0) return true;
        const size_t here = places_[corner];
        const bool shares_before = here - places_[corner - 1] == kShared;
        const bool shares_after = places_[corner + 1] - here == kShared && corner + 2 < places_.size();
        const size_t first = here - (shares_before ? 3 : 2), last = here + (shares_after ? 3 : 2);
        return validator_.look(Spline(points_.data() + first * dof_, last - first + 1, dof_), stop_) == Verdict::kFree;
    }

    MotionValidator& validator_;
    const StopCondition& stop_;
    size_t dof_ = 1;
    std::vector<double> shares_;
    std::vector<double> points_;
    std::vector<size_t> places_;  // of the corners' control points
};

}  // namespace gemelo
