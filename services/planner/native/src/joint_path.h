// A path through the joints' space, in spans of the parameter 0 to 1: straight lines, or the cubics of a B-spline.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "views.h"

namespace gemelo {

using Joints = std::vector<double>;  // (dof,) [rad] or [m]

class JointPath {
  public:
    virtual ~JointPath() = default;
    virtual size_t span_count() const = 0;
    // Where the path is at `share` of a span, into `joints` (dof,).
    virtual void at(size_t span, double share, double* joints) const = 0;
    // The most that each joint value changes per unit of the span's parameter.
    virtual void speed(size_t span, double* speeds) const = 0;
    // How each joint value changes per unit of the span's parameter about `share`, into `rates` (dof,); returns by how
    // much at most it does otherwise within `half` of it, as a share of `speeds`, which are those of the span.
    virtual double rate(size_t span, double share, double half, const double* speeds, double* rates) const = 0;
};

// Through rows (count, dof); a span leads from a row to the one `stride` rows on, or to the last, by way of those
// between them.
class Polyline final : public JointPath {
  public:
    Polyline(const double* rows, size_t count, size_t dof, size_t stride = 1)
        : rows_(rows), count_(count), dof_(dof), stride_(stride) {}

    size_t span_count() const override { return (count_ - 2) / stride_ + 1; }

    void at(size_t span, double share, double* joints) const override {
        if (stride_ == 1) return line_at(rows_ + span * dof_, share, joints);
        const size_t lines = lines_of(span);
        const double along = share * static_cast<double>(lines);
        const size_t line = std::min(static_cast<size_t>(along), lines - 1);
        line_at(rows_ + (span * stride_ + line) * dof_, along - static_cast<double>(line), joints);
    }

    void speed(size_t span, double* speeds) const override {
        const size_t lines = lines_of(span);
        std::fill_n(speeds, dof_, 0.0);
        for (size_t line = 0; line < lines; ++line) {
            const double *from = rows_ + (span * stride_ + line) * dof_, *to = from + dof_;
            for (size_t i = 0; i < dof_; ++i) speeds[i] = std::max(speeds[i], std::abs(to[i] - from[i]));
        }
        for (size_t i = 0; i < dof_; ++i) speeds[i] *= static_cast<double>(lines);
    }

    // Between the least and the largest of the lines that are reached.
    double rate(size_t span, double share, double half, const double* speeds, double* rates) const override {
        if (stride_ == 1) {
            const double *from = rows_ + span * dof_, *to = from + dof_;
            for (size_t i = 0; i < dof_; ++i) rates[i] = to[i] - from[i];
            return 0.0;
        }
        const size_t lines = lines_of(span);
        const double scale = static_cast<double>(lines);
        const size_t first = static_cast<size_t>(std::max(0.0, (share - half) * scale));
        const size_t last = std::min(lines - 1, static_cast<size_t>(std::max(0.0, (share + half) * scale)));
        double most = 0.0;
        for (size_t i = 0; i < dof_; ++i) {
            const double* from = rows_ + (span * stride_ + std::min(first, lines - 1)) * dof_ + i;
            double low = from[dof_] - from[0], high = low;
            for (size_t line = first + 1; line <= last; ++line) {
                from += dof_;
                low = std::min(low, from[dof_] - from[0]);
                high = std::max(high, from[dof_] - from[0]);
            }
            rates[i] = 0.5 * (low + high) * scale;
            if (high > low) most = std::max(most, 0.5 * (high - low) * scale / speeds[i]);
        }
        return most;
    }

  private:
    // At `share` of the line from one row to the next.
    void line_at(const double* from, double share, double* joints) const {
        for (size_t i = 0; i < dof_; ++i) joints[i] = from[i] + share * (from[dof_ + i] - from[i]);
    }

    size_t lines_of(size_t span) const { return std::min(stride_, count_ - 1 - span * stride_); }

    const double* rows_;
    size_t count_, dof_, stride_;
};

// The uniform cubic B-spline of control points (n, dof); span i is that of the points i to i + 3.
//
// With both end points given thrice it begins and ends on them, at rest in its parameter.
class Spline final : public JointPath {
  public:
    Spline(const double* points, size_t count, size_t dof) : points_(points), count_(count), dof_(dof) {}

    size_t span_count() const override { return count_ - 3; }

    void at(size_t span, double u, double* joints) const override {
        const double v = 1.0 - u;
        const double weights[4] = {v * v * v / 6.0, (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
                                   (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0, u * u * u / 6.0};
        for (size_t i = 0; i < dof_; ++i) {
            joints[i] = 0.0;
            for (size_t k = 0; k < 4; ++k) joints[i] += weights[k] * points_[(span + k) * dof_ + i];
        }
    }

    // The derivative is a mean of the three differences, weighted by (1 - u)^2 / 2, 1/2 + u - u^2 and u^2 / 2: with
    // their sizes it is a parabola, whose most is at an end or between.
    void speed(size_t span, double* speeds) const override {
        for (size_t i = 0; i < dof_; ++i) {
            double sizes[3];
            for (size_t k = 0; k < 3; ++k) {
                sizes[k] = std::abs(points_[(span + k + 1) * dof_ + i] - points_[(span + k) * dof_ + i]);
            }
            const double begin = 0.5 * (sizes[0] + sizes[1]), end = 0.5 * (sizes[1] + sizes[2]);
            const double rise = sizes[1] - sizes[0], fall = sizes[1] - sizes[2];  // slopes at the beginning and the end
            const bool is_between = rise > 0.0 && fall > 0.0;
            speeds[i] = is_between ? begin + 0.5 * rise * rise / (rise + fall) : std::max(begin, end);
        }
    }

    // The second derivative goes straight from one second difference of the control points to the next.
    double rate(size_t span, double u, double half, const double* speeds, double* rates) const override {
        double most = 0.0;
        for (size_t i = 0; i < dof_; ++i) {
            const double* p = points_ + span * dof_ + i;
            const double first = p[dof_] - p[0], second = p[2 * dof_] - p[dof_], third = p[3 * dof_] - p[2 * dof_];
            rates[i] = 0.5 * (1.0 - u) * (1.0 - u) * first + (0.5 + u - u * u) * second + 0.5 * u * u * third;
            const double bend = std::max(std::abs(second - first), std::abs(third - second));
            if (bend > 0.0) most = std::max(most, bend / speeds[i]);
        }
        return half * most;
    }

  private:
    const double* points_;
    size_t count_, dof_;
};

}  // namespace gemelo
