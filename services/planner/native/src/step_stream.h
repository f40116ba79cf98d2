// The step stream of a finished trajectory, in doubles: how fast it makes the motors turn, and how much torque that
// takes.
#pragma once

#include "quintic.h"

namespace gemelo {

// The stream between knots: start + u (2 square + u 3 cube) per knot, (knots, dof) each in 1/256 steps, u at `slots`
// even places up to the next knot; `knot` [1/256 steps per step/s] is what turns it into steps/s.
struct StreamView {
    const double *start, *square, *cube;
    size_t knots, dof, slots;
    double knot;
};

// The largest rate [steps/s] of each joint, into `peaks` (dof,); what is no number is larger than all others.
inline void peak_rates(const StreamView& stream, const double* shares, double* peaks) {
    std::fill_n(peaks, stream.dof, 0.0);
    const double cubic = 3.0 / stream.knot, quadratic = 2.0 / stream.knot;
    for (size_t row = 0; row < stream.knots; ++row) {
        for (size_t i = 0; i < stream.dof; ++i) {
            const size_t at = row * stream.dof + i;
            const double cube = cubic * stream.cube[at], square = quadratic * stream.square[at],
                         start = stream.start[at] / stream.knot;
            // Between two places a parabola is never farther from both than a quarter of its bend, and most knots are
            // slower than another one.
            const double last = std::abs(start + square + cube);  // before the first, so that what is no number stays
            const double reached = std::max(last, std::abs(start)) + 0.25 * std::abs(cube);
            if (kNoLess * reached <= peaks[i]) continue;
            for (size_t slot = 0; slot < stream.slots; ++slot) {
                grow(std::abs(shares[slot] * (shares[slot] * cube + square) + start), peaks[i]);
            }
        }
    }
}

// As std::nearbyint, which is a call on processors without SSE4.1, but for the sign of a zero: beyond 2^52 a double has
// no fraction.
inline double nearest_whole(double x) {
    constexpr double kBig = 6755399441055744.0;  // 1.5 * 2^52
    return std::abs(x) < 2251799813685248.0 ? (x + kBig) - kBig : std::nearbyint(x);
}

// From one knot to another of a trajectory of so many points, `knot` [s] apart; `scale` (dof,) [1/256 steps per rad or
// m]. After the knot `last` the arm stands.
struct KnotsView {
    const double* scale;
    size_t points, begin, end, last;
    double knot, subdivision;
};

// The coefficients of a stream, as of `StreamView`.
struct Stream {
    std::vector<double> start, square, cube;
};

// The stream that is made of the trajectory.
inline Stream stream_of(const TrajectoryView& trajectory, const KnotsView& knots) {
    const size_t dof = trajectory.dof, rows = knots.end - knots.begin + 1;
    const double duration = trajectory.stamps[knots.points - 1];
    std::vector<double> position(rows * dof), slope(rows * dof);
    Segment quintics;
    size_t segment = 0;
    quintics.begin(trajectory, 0);
    for (size_t row = 0; row < rows; ++row) {
        const double time = std::min(static_cast<double>(knots.begin + row) * knots.knot, duration);
        const size_t before = segment;
        while (segment + 2 < knots.points && trajectory.stamps[segment + 1] <= time) ++segment;
        if (segment != before) quintics.begin(trajectory, segment);
        double *at = &position[row * dof], *speed = &slope[row * dof];
        quintics.move(time, at, speed);
        const bool is_last = row + 1 == rows && knots.end == knots.last;
        for (size_t i = 0; i < dof; ++i) {
            at[i] = nearest_whole(at[i] * knots.scale[i]);
            speed[i] = is_last ? 0.0 : nearest_whole(speed[i] * knots.scale[i]) * knots.knot;
        }
    }
    std::vector<double> square((rows - 1) * dof), cube((rows - 1) * dof);
    for (size_t i = 0; i < square.size(); ++i) {
        const double rise = position[i + dof] - position[i];
        square[i] = 3.0 * rise - 2.0 * slope[i] - slope[i + dof];
        cube[i] = slope[i] + slope[i + dof] - 2.0 * rise;
    }
    return {std::move(slope), std::move(square), std::move(cube)};
}

// What a motor turns against, and its pull-out torque [Nm] over the rate [steps/s], in ascending order of the latter.
struct MotorView {
    double inertia, friction, turn;  // [kg m^2], [Nm], [rad/step]
    std::vector<double> speed, torque;
};

// As numpy.interp, beyond the curve 0.
inline double pull_out(const MotorView& motor, double rate) {
    const size_t after =
        static_cast<size_t>(std::upper_bound(motor.speed.begin(), motor.speed.end(), rate) - motor.speed.begin());
    if (after == 0) return motor.torque.front();
    const size_t at = after - 1;
    if (motor.speed[at] == rate) return motor.torque[at];
    if (after == motor.speed.size()) return 0.0;
    const double slope = (motor.torque[after] - motor.torque[at]) / (motor.speed[after] - motor.speed[at]);
    return slope * (rate - motor.speed[at]) + motor.torque[at];
}

// The largest share of its pull-out torque that the joint's motor needs for inertia and friction; `knot` [s].
inline double torque_share(const StreamView& stream, const double* shares, size_t joint, const MotorView& motor,
                           double knot, double subdivision) {
    const double cubic = 3.0 / stream.knot, quadratic = 2.0 / stream.knot, squared = knot * knot;
    double most = 0.0;
    for (size_t at = joint; at < stream.knots * stream.dof; at += stream.dof) {
        const double square = stream.square[at], cube = stream.cube[at], start = stream.start[at] / stream.knot;
        for (size_t slot = 0; slot < stream.slots; ++slot) {
            const double u = shares[slot], rate = u * (u * (cubic * cube) + quadratic * square) + start;
            const double gain = (2.0 * square + u * 6.0 * cube) / squared / subdivision;
            const double sign = rate > 0.0 ? 1.0 : rate < 0.0 ? -1.0 : 0.0;
            const double needed = std::abs(motor.inertia * gain * motor.turn + motor.friction * sign);
            if (needed > 0.0) grow(needed / pull_out(motor, std::abs(rate)), most);
        }
    }
    return most;
}

}  // namespace gemelo
