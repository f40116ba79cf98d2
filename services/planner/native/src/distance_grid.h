// Cells around a mesh: how far the surface is at least from any point in a cell, and what is in the cell.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace gemelo {

using Vector = std::array<double, 3>;
using Triangle = std::array<Vector, 3>;

inline Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline double length(const Vector& a) { return std::sqrt(dot(a, a)); }

// True if the triangle and the axis-aligned cube share a point (separating axes; Akenine-Moller 2001).
inline bool reaches_cube(const Triangle& triangle, const Vector& centre, double half) {
    const Vector corners[3] = {minus(triangle[0], centre), minus(triangle[1], centre), minus(triangle[2], centre)};
    const auto is_separating = [&](const Vector& axis) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (const Vector& corner : corners) {
            low = std::min(low, dot(axis, corner));
            high = std::max(high, dot(axis, corner));
        }
        const double reach = half * (std::abs(axis[0]) + std::abs(axis[1]) + std::abs(axis[2]));
        return low > reach || high < -reach;
    };
    const Vector units[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (const Vector& unit : units) {
        if (is_separating(unit)) return false;
    }
    for (size_t i = 0; i < 3; ++i) {
        const Vector edge = minus(corners[(i + 1) % 3], corners[i]);
        for (const Vector& unit : units) {
            if (is_separating(cross(edge, unit))) return false;
        }
    }
    return !is_separating(cross(minus(corners[1], corners[0]), minus(corners[2], corners[0])));
}

// The share of all directions in which a closed surface is seen from its inside: 1 inside, 0 outside.
inline double winding_number(const std::vector<Triangle>& triangles, const Vector& point) {
    double sum = 0.0;
    for (const Triangle& triangle : triangles) {
        const Vector a = minus(triangle[0], point), b = minus(triangle[1], point), c = minus(triangle[2], point);
        const double la = length(a), lb = length(b), lc = length(c);
        const double below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        sum += 2.0 * std::atan2(dot(a, cross(b, c)), below);  // Van Oosterom and Strackee (1983)
    }
    return sum / (4.0 * 3.14159265358979323846);
}

enum class CellKind : uint8_t { kEmpty, kSurface, kSolid };

class DistanceGrid {
  public:
    std::array<int32_t, 3> size{};
    Vector low{};
    double cell = 0.0;
    std::vector<float> cells;  // [m]; x runs fastest
    std::vector<CellKind> kinds;

    DistanceGrid() = default;

    // `most` cells along the longest side, or cells of the edge `wanted` [m] where that is given.
    explicit DistanceGrid(const std::vector<Triangle>& triangles, double wanted = 0.0, int most = 64) {
        lay_out(triangles, wanted, most);
        std::vector<float> squares = mark_surface(triangles);
        find_kinds(triangles, squares);
        spread_along(squares, 0);
        spread_along(squares, 1);
        spread_along(squares, 2);
        // Half a diagonal for the point in its cell, half a one for the surface in its own.
        const double diagonal = std::sqrt(3.0) * cell;
        for (size_t i = 0; i < squares.size(); ++i) {
            const double promise = 0.9999 * (cell * std::sqrt(static_cast<double>(squares[i])) - diagonal);
            cells[i] = static_cast<float>(std::max(0.0, promise));
        }
    }

    Vector centre(size_t index) const {
        const size_t x = index % side(0), y = index / side(0) % side(1), z = index / (side(0) * side(1));
        return {low[0] + cell * (static_cast<double>(x) + 0.5), low[1] + cell * (static_cast<double>(y) + 0.5),
                low[2] + cell * (static_cast<double>(z) + 0.5)};
    }

  private:
    static constexpr int kMostSolids = 64;  // that are asked, each of all triangles; chosen: in more all are solid

    size_t side(size_t axis) const { return static_cast<size_t>(size[axis]); }
    size_t step(size_t axis) const { return axis == 0 ? 1 : axis == 1 ? side(0) : side(0) * side(1); }

    void lay_out(const std::vector<Triangle>& triangles, double wanted, int most) {
        Vector high{};
        low.fill(std::numeric_limits<double>::infinity());
        high.fill(-low[0]);
        for (const Triangle& triangle : triangles) {
            for (const Vector& corner : triangle) {
                for (size_t axis = 0; axis < 3; ++axis) {
                    low[axis] = std::min(low[axis], corner[axis]);
                    high[axis] = std::max(high[axis], corner[axis]);
                }
            }
        }
        const Vector extent = minus(high, low);
        const double longest = std::max({extent[0], extent[1], extent[2], 1e-6});
        cell = wanted > 0.0 ? wanted : longest / most;
        for (size_t axis = 0; axis < 3; ++axis) {
            size[axis] = static_cast<int32_t>(std::ceil(extent[axis] / cell)) + 3;  // an empty cell on each side
            low[axis] -= 0.5 * (size[axis] * cell - extent[axis]);
        }
        cells.assign(side(0) * side(1) * side(2), 0.0f);
    }

    // 0 in the cells that a triangle reaches, infinity elsewhere.
    std::vector<float> mark_surface(const std::vector<Triangle>& triangles) const {
        std::vector<float> marks(cells.size(), std::numeric_limits<float>::infinity());
        for (const Triangle& triangle : triangles) {
            std::array<size_t, 3> from{}, to{};
            for (size_t axis = 0; axis < 3; ++axis) {
                const auto [least, most] = std::minmax({triangle[0][axis], triangle[1][axis], triangle[2][axis]});
                from[axis] = index_at(least - 1e-6 * cell, axis);
                to[axis] = index_at(most + 1e-6 * cell, axis);
            }
            for (size_t z = from[2]; z <= to[2]; ++z) {
                for (size_t y = from[1]; y <= to[1]; ++y) {
                    for (size_t x = from[0]; x <= to[0]; ++x) {
                        const size_t index = x + side(0) * (y + side(1) * z);
                        if (reaches_cube(triangle, centre(index), 0.5001 * cell)) marks[index] = 0.0f;
                    }
                }
            }
        }
        return marks;
    }

    size_t index_at(double value, size_t axis) const {
        const double at = std::floor((value - low[axis]) / cell);
        return static_cast<size_t>(std::min(std::max(at, 0.0), static_cast<double>(size[axis] - 1)));
    }

    // Every region that the surface cuts off from the rest is solid where the surface winds around it.
    void find_kinds(const std::vector<Triangle>& triangles, const std::vector<float>& surface) {
        std::vector<uint8_t> seen(cells.size(), 0);
        kinds.assign(cells.size(), CellKind::kEmpty);
        int regions = 0;
        for (size_t i = 0; i < cells.size(); ++i) {
            if (surface[i] == 0.0f) kinds[i] = CellKind::kSurface;
            if (seen[i] || surface[i] == 0.0f) continue;
            const std::vector<size_t> region = flood(i, surface, seen);
            const bool is_outside = i == 0;  // the first cell is an empty one at the grid's corner
            if (is_outside) continue;
            const Vector inner = centre(region[region.size() / 2]);
            const bool is_solid = ++regions > kMostSolids || std::abs(winding_number(triangles, inner)) > 0.5;
            for (size_t index : region) kinds[index] = is_solid ? CellKind::kSolid : CellKind::kEmpty;
        }
    }

    std::vector<size_t> flood(size_t from, const std::vector<float>& surface, std::vector<uint8_t>& seen) const {
        std::vector<size_t> region{from};
        seen[from] = 1;
        for (size_t next = 0; next < region.size(); ++next) {
            for (size_t axis = 0; axis < 3; ++axis) {
                const size_t at = region[next] / step(axis) % side(axis);
                for (const bool up : {false, true}) {
                    if (up ? at + 1 == side(axis) : at == 0) continue;
                    const size_t other = up ? region[next] + step(axis) : region[next] - step(axis);
                    if (seen[other] || surface[other] == 0.0f) continue;
                    seen[other] = 1;
                    region.push_back(other);
                }
            }
        }
        return region;
    }

    // One axis of the exact squared distance transform, in cells: lower envelopes of parabolas (Felzenszwalb 2012).
    void spread_along(std::vector<float>& squares, size_t axis) const {
        const size_t n = side(axis), stride = step(axis);
        std::vector<double> values(n), bounds(n + 1);
        std::vector<size_t> apex(n);
        for (size_t start = 0; start < squares.size(); ++start) {
            if (start / stride % n != 0) continue;
            for (size_t i = 0; i < n; ++i) values[i] = static_cast<double>(squares[start + i * stride]);
            const size_t count = envelope(values, apex, bounds);
            for (size_t i = 0, k = 0; i < n && count > 0; ++i) {
                while (k + 1 < count && bounds[k + 1] < static_cast<double>(i)) ++k;
                const double off = static_cast<double>(i) - static_cast<double>(apex[k]);
                squares[start + i * stride] = static_cast<float>(values[apex[k]] + off * off);
            }
        }
    }

    // The parabolas i -> values[apex] + (i - apex)^2 that are the lowest somewhere, and from where on each is.
    static size_t envelope(const std::vector<double>& values, std::vector<size_t>& apex, std::vector<double>& bounds) {
        size_t count = 0;
        for (size_t i = 0; i < values.size(); ++i) {
            if (!std::isfinite(values[i])) continue;
            const double at = static_cast<double>(i);
            double from = -std::numeric_limits<double>::infinity();
            while (count > 0) {
                const double top = static_cast<double>(apex[count - 1]);
                from = (values[i] + at * at - values[apex[count - 1]] - top * top) / (2.0 * (at - top));
                if (from > bounds[count - 1]) break;
                from = -std::numeric_limits<double>::infinity();
                --count;
            }
            apex[count] = i;
            bounds[count++] = from;
        }
        return count;
    }
};

}  // namespace gemelo
