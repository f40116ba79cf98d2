// The quintics through a trajectory's points, and the step rates of the stream that is made of them: what a finished
// trajectory is verified by, in doubles.
//
// The operations stand in the order of services/planner/verification, which computes the same where this is not built.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace gemelo {

// Points by rows: `stamps` (points,) [s], positions, velocities and accelerations (points, dof).
struct TrajectoryView {
    const double *stamps, *positions, *velocities, *accelerations;
    size_t dof;
};

// Where a sample is written, (dof,) each.
struct SampleView {
    double *positions, *velocities, *accelerations, *jerks;
};

// One joint between two points, as a polynomial of the share u of the segment, which lasts `dt` [s] (Biagiotti and
// Melchiorri 2008, section 2.1).
struct Quintic {
    double p0, v0, a0, third, fourth, fifth;

    Quintic() = default;
    Quintic(const TrajectoryView& trajectory, size_t index, size_t joint, double dt) {
        const size_t from = index * trajectory.dof + joint, to = from + trajectory.dof;
        p0 = trajectory.positions[from], v0 = trajectory.velocities[from] * dt;
        a0 = trajectory.accelerations[from] * dt * dt;
        const double rise = trajectory.positions[to] - p0 - v0 - 0.5 * a0;
        const double climb = trajectory.velocities[to] * dt - v0 - a0,
                     bend = trajectory.accelerations[to] * dt * dt - a0;
        third = 10.0 * rise - 4.0 * climb + bend / 2.0, fourth = -15.0 * rise + 7.0 * climb - bend;
        fifth = 6.0 * rise - 3.0 * climb + bend / 2.0;
    }
};

// The joints between the points `index` and `index` + 1.
class Segment {
  public:
    void begin(const TrajectoryView& trajectory, size_t index) {
        began_ = trajectory.stamps[index], dt_ = trajectory.stamps[index + 1] - began_;
        squared_ = dt_ * dt_, cubed_ = std::pow(dt_, 3.0);
        joints_.resize(trajectory.dof);
        for (size_t i = 0; i < trajectory.dof; ++i) joints_[i] = Quintic(trajectory, index, i, dt_);
    }

    // At `time` [s].
    void sample(double time, const SampleView& sample) const {
        const double u = (time - began_) / dt_;
        move(time, sample.positions, sample.velocities);
        for (size_t i = 0; i < joints_.size(); ++i) {
            const auto [p0, v0, a0, third, fourth, fifth] = joints_[i];
            sample.accelerations[i] = (a0 + u * (6.0 * third + u * (12.0 * fourth + u * 20.0 * fifth))) / squared_;
            sample.jerks[i] = (6.0 * third + u * (24.0 * fourth + u * 60.0 * fifth)) / cubed_;
        }
    }

    // As `sample`, of positions and velocities alone.
    void move(double time, double* positions, double* velocities) const {
        const double u = (time - began_) / dt_;
        for (size_t i = 0; i < joints_.size(); ++i) {
            const auto [p0, v0, a0, third, fourth, fifth] = joints_[i];
            positions[i] = p0 + u * (v0 + u * (a0 / 2.0 + u * (third + u * (fourth + u * fifth))));
            velocities[i] = (v0 + u * (a0 + u * (3.0 * third + u * (4.0 * fourth + u * 5.0 * fifth)))) / dt_;
        }
    }

  private:
    double began_ = 0.0, dt_ = 1.0, squared_ = 1.0, cubed_ = 1.0;
    std::vector<Quintic> joints_;
};

// The least and the largest positions, and the largest sizes of the derivatives, (dof,) each.
struct ExtremesView {
    double *lower, *upper, *velocity, *acceleration, *jerk;
};

// What is no number is larger than all others and less than all others, and stays.
inline void grow(double value, double& largest) {
    if (!(value <= largest) && !std::isnan(largest)) largest = value;
}
inline void shrink(double value, double& least) {
    if (!(value >= least) && !std::isnan(least)) least = value;
}

// Chosen: more than what rounding takes from a bound, which is of the size of all the terms that it bounds.
constexpr double kNoLess = 1.0 + 1e-10;

// No less than the size of c0 + c1 u + c2 u^2 + c3 u^3 + c4 u^4 for u from 0 to 1: a polynomial lies between the least
// and the largest of its coefficients by Bernstein (Farouki 2012, section 5.1). What is no number stays.
inline double bound(double c0, double c1, double c2, double c3 = 0.0, double c4 = 0.0) {
    double most = 0.0;
    grow(std::abs(c0), most);
    grow(std::abs(c0 + c1 / 4.0), most);
    grow(std::abs(c0 + c1 / 2.0 + c2 / 6.0), most);
    grow(std::abs(c0 + 3.0 * c1 / 4.0 + c2 / 2.0 + c3 / 4.0), most);
    grow(std::abs(c0 + c1 + c2 + c3 + c4), most);
    return kNoLess * most;
}

// Samples at so many `shares` of each segment: positions by rows into `positions`, and what they and their derivatives
// reach. Derivatives are only looked at in segments in which they may reach farther than before.
inline void sample_all(const TrajectoryView& trajectory, size_t segments, const double* shares, size_t count,
                       double* positions, const ExtremesView& reached) {
    const size_t dof = trajectory.dof;
    for (double* most : {reached.velocity, reached.acceleration, reached.jerk}) std::fill_n(most, dof, 0.0);
    std::copy_n(trajectory.positions, dof, reached.lower);
    std::copy_n(trajectory.positions, dof, reached.upper);
    std::vector<double> places(count);
    for (size_t segment = 0; segment < segments; ++segment, positions += count * dof) {
        const double begin = trajectory.stamps[segment], lasts = trajectory.stamps[segment + 1] - begin;
        const double squared = lasts * lasts, cubed = std::pow(lasts, 3.0);
        for (size_t place = 0; place < count; ++place) places[place] = (begin + shares[place] * lasts - begin) / lasts;
        for (size_t i = 0; i < dof; ++i) {
            const auto [p0, v0, a0, third, fourth, fifth] = Quintic(trajectory, segment, i, lasts);
            double least = reached.lower[i], largest = reached.upper[i], sum = 0.0;
            for (size_t place = 0; place < count; ++place) {
                const double u = places[place];
                const double position = p0 + u * (v0 + u * (a0 / 2.0 + u * (third + u * (fourth + u * fifth))));
                positions[place * dof + i] = position;
                least = std::min(least, position);
                largest = std::max(largest, position);
                sum += position;
            }
            grow(std::isnan(sum) ? sum : largest, reached.upper[i]);
            shrink(std::isnan(sum) ? sum : least, reached.lower[i]);
            if (!(bound(v0, a0, 3.0 * third, 4.0 * fourth, 5.0 * fifth) / lasts <= reached.velocity[i])) {
                for (const double u : places) {
                    const double velocity =
                        (v0 + u * (a0 + u * (3.0 * third + u * (4.0 * fourth + u * 5.0 * fifth)))) / lasts;
                    grow(std::abs(velocity), reached.velocity[i]);
                }
            }
            if (!(bound(a0, 6.0 * third, 12.0 * fourth, 20.0 * fifth) / squared <= reached.acceleration[i])) {
                for (const double u : places) {
                    const double acceleration =
                        (a0 + u * (6.0 * third + u * (12.0 * fourth + u * 20.0 * fifth))) / squared;
                    grow(std::abs(acceleration), reached.acceleration[i]);
                }
            }
            if (!(bound(6.0 * third, 24.0 * fourth, 60.0 * fifth) / cubed <= reached.jerk[i])) {
                for (const double u : places) {
                    grow(std::abs((6.0 * third + u * (24.0 * fourth + u * 60.0 * fifth)) / cubed), reached.jerk[i]);
                }
            }
        }
    }
}

// How far any of `rows` (count, dof) is at most from the line between two rows (2, dof), in any joint.
inline double aside(const double* line, const double* rows, size_t count, size_t dof) {
    const double* to = line + dof;
    double squared = 0.0, most = 0.0;
    for (size_t i = 0; i < dof; ++i) squared += (to[i] - line[i]) * (to[i] - line[i]);
    for (size_t row = 0; row < count; ++row, rows += dof) {
        double along = 0.0;
        for (size_t i = 0; i < dof; ++i) along += (rows[i] - line[i]) * (to[i] - line[i]);
        const double share = squared > 0.0 ? std::min(1.0, std::max(0.0, along / squared)) : 0.0;
        for (size_t i = 0; i < dof; ++i) grow(std::abs(rows[i] - (line[i] + share * (to[i] - line[i]))), most);
    }
    return most;
}

}  // namespace gemelo
