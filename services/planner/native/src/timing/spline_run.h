// A path without corners, by its length: a uniform cubic B-spline as cubic pieces, with derivatives by arc length.
//
// Lengths are times at full speed: joint values are divided by the joints' speed limits. The operations stand in the
// order of services/planner/path/curve.py.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "../views.h"
#include "states.h"

namespace gemelo {

// Tuning constants, chosen as in curve.py.
constexpr size_t kPieceParts = 8;    // of a piece, within which its length is integrated and looked up
constexpr int kLengthNewton = 3;     // steps from the look-up to the parameter
constexpr double kSmallest = 1e-12;  // of a path's whole length: a piece that is shorter is none
constexpr double kCorner = 1e-6;     // between two unit tangents: beyond it the path has a corner
constexpr double kSlowest = 1e-3;    // of the mean speed in the parameter: below it a piece turns on the spot
constexpr double kNodes[5] = {0.04691007703066802, 0.23076534494715845, 0.5, 0.7692346550528415, 0.9530899229693319};
constexpr double kWeights[5] = {0.11846344252809464, 0.23931433524968315, 0.28444444444444433, 0.23931433524968315,
                                0.11846344252809464};

// Derivatives of the joint values by the length at one place, divided by the speed limits.
struct PathPoint {
    double value[kMaxDof], first[kMaxDof], second[kMaxDof], third[kMaxDof];
};

// In powers of u, from 0 to 1: (4, n) coefficients, and the square of the speed in the parameter.
struct CubicPiece {
    double c[4][kMaxDof];
    double squares[5];

    void measure(size_t dof) {
        std::fill_n(squares, 5, 0.0);
        for (size_t i = 0; i < dof; ++i) {
            const double d0 = c[1][i], d1 = 2.0 * c[2][i], d2 = 3.0 * c[3][i];
            squares[0] += d0 * d0;
            squares[1] += 2.0 * d0 * d1;
            squares[2] += d1 * d1 + 2.0 * d0 * d2;
            squares[3] += 2.0 * d1 * d2;
            squares[4] += d2 * d2;
        }
    }
    double speed(double u) const {
        const double s = squares[0] + u * (squares[1] + u * (squares[2] + u * (squares[3] + u * squares[4])));
        return std::sqrt(std::max(s, 0.0));
    }
    double integral(double begin, double width) const {
        double sum = 0.0;
        for (int k = 0; k < 5; ++k) sum += speed(begin + width * kNodes[k]) * kWeights[k];
        return sum * width;
    }
    // By the chain rule; r is the speed in the parameter, r1 and r2 its derivatives by that.
    void at(double u, size_t dof, PathPoint& point) const {
        double y1[kMaxDof], y2[kMaxDof], y3[kMaxDof], squared = 0.0, along = 0.0, bent = 0.0;
        for (size_t i = 0; i < dof; ++i) {
            point.value[i] = c[0][i] + u * (c[1][i] + u * (c[2][i] + u * c[3][i]));
            y1[i] = c[1][i] + u * (2.0 * c[2][i] + u * 3.0 * c[3][i]);
            y2[i] = 2.0 * c[2][i] + u * 6.0 * c[3][i];
            y3[i] = 6.0 * c[3][i];
            squared += y1[i] * y1[i];
            along += y1[i] * y2[i];
            bent += y2[i] * y2[i] + y1[i] * y3[i];
        }
        const double r = std::sqrt(squared), r1 = along / r, r2 = (bent - r1 * r1) / r;
        for (size_t i = 0; i < dof; ++i) {
            const double first = y1[i] / r, second = (y2[i] - first * r1) / (r * r);
            point.first[i] = first;
            point.second[i] = second;
            point.third[i] = ((y3[i] - second * r * r1 - first * r2) / (r * r) - 2.0 * r1 * second / r) / r;
        }
    }
};

// A smooth run of pieces, by its length.
class SplineRun {
  public:
    // Throws `TurnsOnTheSpot`.
    SplineRun(std::vector<CubicPiece> pieces, size_t dof) : pieces_(std::move(pieces)), dof_(dof) {
        lengths_.reserve(pieces_.size() * kPieceParts + 1);
        lengths_.push_back(0.0);
        double least = INFINITY;
        for (CubicPiece& piece : pieces_) {
            piece.measure(dof);
            for (size_t part = 0; part < kPieceParts; ++part) {
                const double step = piece.integral(begin_of(part), 1.0 / kPieceParts);
                least = std::min(least, step);
                lengths_.push_back(lengths_.back() + step);
            }
        }
        const double count = static_cast<double>(pieces_.size());
        if (least < kSlowest * (length() / (count * kPieceParts)) / count) {
            throw TurnsOnTheSpot("the curve turns on the spot");
        }
    }

    double length() const { return lengths_.back(); }
    size_t count() const { return pieces_.size(); }
    size_t dof() const { return dof_; }

    // The length at which a piece begins, after this many parts of all pieces.
    double length_after(size_t parts) const { return lengths_[parts]; }

    void at(double length, PathPoint& point) const {
        const double within = std::min(std::max(length, 0.0), this->length());
        const auto after = std::upper_bound(lengths_.begin(), lengths_.end(), within);
        const size_t row = std::min(static_cast<size_t>(after - lengths_.begin()) - 1, lengths_.size() - 2);
        const CubicPiece& piece = pieces_[row / kPieceParts];
        const double begin = begin_of(row % kPieceParts), wanted = within - lengths_[row];
        double width = wanted / (lengths_[row + 1] - lengths_[row]) / kPieceParts;
        for (int step = 0; step < kLengthNewton; ++step) {
            const double missing = wanted - piece.integral(begin, width);
            width = std::min(std::max(width + missing / piece.speed(begin + width), 0.0), 1.0 / kPieceParts);
        }
        piece.at(begin + width, dof_, point);
    }

    // Where the parameter of a piece is `u`.
    void inside(size_t piece, double u, PathPoint& point) const { pieces_[piece].at(u, dof_, point); }

  private:
    static double begin_of(size_t part) { return static_cast<double>(part) / kPieceParts; }

    std::vector<CubicPiece> pieces_;
    size_t dof_;
    std::vector<double> lengths_;  // from the begin of the run to that of every part, and to the end
};

// The pieces of the curve of `control` (rows, dof); one that rests at one of its ends is a straight line, so it is
// given an even speed.
inline std::vector<CubicPiece> straightened_pieces(const double* control, size_t rows, const LimitsView& limits) {
    const size_t dof = limits.dof;
    std::vector<double> scaled(rows * dof);
    for (size_t i = 0; i < rows * dof; ++i) scaled[i] = control[i] / limits.velocity[i % dof];
    std::vector<CubicPiece> pieces(rows - 3);
    const auto is_same = [&](size_t row) {
        return std::equal(&scaled[row * dof], &scaled[row * dof] + dof, &scaled[(row + 1) * dof]);
    };
    for (size_t k = 0; k < pieces.size(); ++k) {
        auto& c = pieces[k].c;
        const double *p0 = &scaled[k * dof], *p1 = p0 + dof, *p2 = p1 + dof, *p3 = p2 + dof;
        const bool is_resting = is_same(k + 1) && (is_same(k) || is_same(k + 2));
        for (size_t i = 0; i < dof; ++i) {
            c[0][i] = p0[i] / 6.0 + p1[i] * (4.0 / 6.0) + p2[i] / 6.0;
            c[1][i] = -0.5 * p0[i] + 0.5 * p2[i];
            c[2][i] = 0.5 * p0[i] - p1[i] + 0.5 * p2[i];
            c[3][i] = -p0[i] / 6.0 + 0.5 * p1[i] - 0.5 * p2[i] + p3[i] / 6.0;
            if (!is_resting) continue;
            c[1][i] = c[0][i] + c[1][i] + c[2][i] + c[3][i] - c[0][i];
            c[2][i] = c[3][i] = 0.0;
        }
    }
    return pieces;
}

// True if the second piece begins in another direction than the first ends in.
inline bool is_corner(const CubicPiece& before, const CubicPiece& after, size_t dof) {
    double leaving[kMaxDof], one = 0.0, other = 0.0, apart = 0.0;
    for (size_t i = 0; i < dof; ++i) {
        leaving[i] = before.c[1][i] + 2.0 * before.c[2][i] + 3.0 * before.c[3][i];
        one += leaving[i] * leaving[i];
        other += after.c[1][i] * after.c[1][i];
    }
    for (size_t i = 0; i < dof; ++i) {
        const double difference = leaving[i] / std::sqrt(one) - after.c[1][i] / std::sqrt(other);
        apart += difference * difference;
    }
    return std::sqrt(apart) > kCorner;
}

// The parts of the curve of `control` (rows, dof) between its corners, at which it has to stop.
inline std::vector<SplineRun> smooth_runs(const double* control, size_t rows, const LimitsView& limits) {
    const size_t dof = limits.dof;
    const std::vector<CubicPiece> all = straightened_pieces(control, rows, limits);
    std::vector<double> lengths;
    double total = 0.0;
    for (const CubicPiece& piece : all) {
        double squared = 0.0;
        for (size_t i = 0; i < dof; ++i) {
            const double across = piece.c[1][i] + piece.c[2][i] + piece.c[3][i];
            squared += across * across;
        }
        lengths.push_back(std::sqrt(squared));
        total += lengths.back();
    }
    std::vector<SplineRun> runs;
    std::vector<CubicPiece> run;
    for (size_t k = 0; k < all.size(); ++k) {
        if (!(lengths[k] > kSmallest * std::max(total, 1.0))) continue;
        if (!run.empty() && is_corner(run.back(), all[k], dof)) {
            runs.emplace_back(std::move(run), dof);
            run.clear();
        }
        run.push_back(all[k]);
    }
    if (!run.empty()) runs.emplace_back(std::move(run), dof);
    return runs;
}

}  // namespace gemelo
