// A convex solid by its sides: how deep points are in it, and the nearest ones of it, in doubles.
//
// The same as `Polytope` of services/planner/collision_geometry/solids.py, without arrays of points times sides.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

namespace gemelo {

// Sides (count, 4): a unit normal, and what that times a point of the solid is at most.
struct PolytopeView {
    const double* sides;
    size_t count;
};

constexpr size_t kPointsTogether = 64;  // chosen: so many points and depths are at hand while the sides pass by

// How deep each of `points` (count, 3) is, below 0 outside, there at most as far as the surface is, into `depths`.
inline void depths_in(const PolytopeView& solid, const double* points, size_t count, double* depths) {
    double x[kPointsTogether], y[kPointsTogether], z[kPointsTogether], depth[kPointsTogether];
    for (size_t first = 0; first < count; first += kPointsTogether) {
        const size_t some = std::min(kPointsTogether, count - first);
        for (size_t i = 0; i < kPointsTogether; ++i) {
            const double* point = points + 3 * (first + std::min(i, some - 1));
            x[i] = point[0], y[i] = point[1], z[i] = point[2];
            depth[i] = std::numeric_limits<double>::infinity();
        }
        for (size_t side = 0; side < solid.count; ++side) {
            const double *row = solid.sides + 4 * side, nx = row[0], ny = row[1], nz = row[2], most = row[3];
            for (size_t i = 0; i < kPointsTogether; ++i) {
                const double here = most - (x[i] * nx + y[i] * ny + z[i] * nz);
                depth[i] = here < depth[i] ? here : depth[i];
            }
        }
        std::copy_n(depth, some, depths + first);
    }
}

// Moves each of `points` (count, 3) that is outside onto the plane that it is farthest beyond, and again, at most so
// many `times` (projections onto convex sets).
inline void project_onto(const PolytopeView& solid, double* points, size_t count, int times) {
    for (double* point = points; point < points + 3 * count; point += 3) {
        for (int time = 0; time < times; ++time) {
            double farthest = 0.0;
            const double* worst = nullptr;
            for (const double* row = solid.sides; row < solid.sides + 4 * solid.count; row += 4) {
                const double beyond = point[0] * row[0] + point[1] * row[1] + point[2] * row[2] - row[3];
                if (beyond > farthest) farthest = beyond, worst = row;
            }
            if (worst == nullptr) break;
            for (size_t i = 0; i < 3; ++i) point[i] -= farthest * worst[i];
        }
    }
}

}  // namespace gemelo
