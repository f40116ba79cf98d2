// Self-motion of a redundant arm: its joints go towards the middles of their ranges, the tool stays. In doubles; the
// steps are those of services/planner/kinematics/centring.py.
#pragma once

#include <algorithm>
#include <cmath>

#include "descent.h"

namespace gemelo {

enum class Centred { kNoFreedom, kDone };

// One of Jacobi's rotations: takes a[p][q] and a[q][p] away.
inline void rotate(size_t size, double (*a)[kMaxDof], double (*v)[kMaxDof], size_t p, size_t q) {
    if (a[p][q] == 0.0) return;
    const double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    const double t = (theta < 0.0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
    const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
    const auto turn = [c, s](double& one, double& other) {
        const double first = one, second = other;
        one = c * first - s * second;
        other = s * first + c * second;
    };
    for (size_t k = 0; k < size; ++k) turn(a[k][p], a[k][q]);
    for (size_t k = 0; k < size; ++k) turn(a[p][k], a[q][k]);
    for (size_t k = 0; k < size; ++k) turn(v[k][p], v[k][q]);
}

// The eigenvalues of the symmetric matrix `a` on its diagonal, its eigenvectors in the columns of `v`.
inline void diagonalise(size_t size, double (*a)[kMaxDof], double (*v)[kMaxDof]) {
    constexpr double kSettled = 1e-15;  // of the largest element, left beside the diagonal; chosen: a few roundings
    for (size_t i = 0; i < size; ++i) {
        for (size_t j = 0; j < size; ++j) v[i][j] = i == j ? 1.0 : 0.0;
    }
    for (int sweep = 0; sweep < 30; ++sweep) {
        double beside = 0.0, most = 0.0;
        for (size_t i = 0; i < size; ++i) {
            for (size_t j = 0; j < i; ++j) beside = std::max(beside, std::abs(a[i][j]));
            most = std::max(most, std::abs(a[i][i]));
        }
        if (beside <= kSettled * most) return;
        for (size_t p = 0; p + 1 < size; ++p) {
            for (size_t q = p + 1; q < size; ++q) rotate(size, a, v, p, q);
        }
    }
}

class Centring {
  public:
    // `middle` and `weight` (dof,): a joint without limits has weight 0.
    Centring(const ToolDescent& arm, const ToolTarget& target, const double* middle, const double* weight)
        : descent_(arm, target), dof_(arm.lower.size()), middle_(middle), weight_(weight) {}

    // Moves the solution `joints` (dof,) in place, while a step brings them nearer to the middles.
    Centred run(double* joints) {
        for (int step = 0; step < kSteps; ++step) {
            const size_t freedom = find_free_motions(joints);
            if (freedom == 0) return step == 0 ? Centred::kNoFreedom : Centred::kDone;
            double next[kMaxDof];
            step_from(joints, freedom, next);
            const bool is_there = descent_.run(next).is_there;
            if (!is_there || !(eccentricity(next) < (1.0 - kLeastGain) * eccentricity(joints))) break;
            std::copy(next, next + dof_, joints);
        }
        return Centred::kDone;
    }

  private:
    // Chosen as in centring.py.
    static constexpr int kSteps = 6;
    static constexpr double kLargestStep = 0.5;  // [rad] or [m]
    static constexpr double kLeastGain = 1e-3;   // share of the eccentricity by which a step must improve
    static constexpr double kRank = 1e-6;        // share of the largest singular value below which there is no motion

    double eccentricity(const double* joints) const {
        double sum = 0.0;
        for (size_t i = 0; i < dof_; ++i) {
            const double away = (joints[i] - middle_[i]) * weight_[i];
            sum += away * away;
        }
        return sum;
    }

    // Orthonormal motions that leave the tool where it is, as the first columns of `motions_`; how many there are.
    size_t find_free_motions(const double* joints) {
        double squared[kMaxDof][kMaxDof], turned[kMaxDof][kMaxDof];
        descent_.squared_jacobian(joints, squared);
        diagonalise(dof_, squared, turned);
        double most = 0.0;
        for (size_t i = 0; i < dof_; ++i) most = std::max(most, squared[i][i]);
        size_t freedom = 0;
        for (size_t k = 0; k < dof_; ++k) {
            if (squared[k][k] > kRank * kRank * most) continue;
            for (size_t i = 0; i < dof_; ++i) motions_[i][freedom] = turned[i][k];
            ++freedom;
        }
        return freedom;
    }

    // The free motion that brings the joints nearest to their middles, at most `kLargestStep` of each.
    void step_from(const double* joints, size_t freedom, double* next) const {
        double normal[kMaxDof][kMaxDof], turned[kMaxDof][kMaxDof], right[kMaxDof];
        for (size_t k = 0; k < freedom; ++k) {
            right[k] = 0.0;
            for (size_t i = 0; i < dof_; ++i) {
                right[k] -= motions_[i][k] * weight_[i] * ((joints[i] - middle_[i]) * weight_[i]);
            }
            for (size_t m = 0; m < freedom; ++m) {
                normal[k][m] = 0.0;
                for (size_t i = 0; i < dof_; ++i) {
                    normal[k][m] += motions_[i][k] * motions_[i][m] * weight_[i] * weight_[i];
                }
            }
        }
        diagonalise(freedom, normal, turned);
        double most = 0.0, amounts[kMaxDof] = {}, step[kMaxDof], longest = 0.0;
        for (size_t k = 0; k < freedom; ++k) most = std::max(most, normal[k][k]);
        for (size_t k = 0; k < freedom; ++k) {
            if (!(normal[k][k] > kRank * kRank * most)) continue;  // moves joints without limits alone
            double share = 0.0;
            for (size_t m = 0; m < freedom; ++m) share += turned[m][k] * right[m];
            for (size_t m = 0; m < freedom; ++m) amounts[m] += turned[m][k] * share / normal[k][k];
        }
        for (size_t i = 0; i < dof_; ++i) {
            step[i] = 0.0;
            for (size_t k = 0; k < freedom; ++k) step[i] += motions_[i][k] * amounts[k];
            longest = std::max(longest, std::abs(step[i]));
        }
        const double scale = std::min(1.0, kLargestStep / std::max(longest, kLargestStep));
        for (size_t i = 0; i < dof_; ++i) next[i] = joints[i] + scale * step[i];
    }

    DescentRun descent_;
    size_t dof_;
    const double *middle_, *weight_;
    double motions_[kMaxDof][kMaxDof];
};

}  // namespace gemelo
