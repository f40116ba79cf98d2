// The squared distance from eight points to an obstacle; 0 inside.
#pragma once

#include "placement.h"

namespace gemelo {
namespace {

inline Lanes beyond(const Lanes& value, float half) { return larger(magnitude(value) - half, 0.0f); }

inline Lanes box_gap(const Point& p, const float* half) {
    return squared(Point{beyond(p.x, half[0]), beyond(p.y, half[1]), beyond(p.z, half[2])});
}

inline Lanes cylinder_gap(const Point& p, const float* size) {
    const Lanes aside = larger(square_root(p.x * p.x + p.y * p.y) - size[0], 0.0f);
    const Lanes above = beyond(p.z, size[2]);
    return aside * aside + above * above;
}

inline Lanes half_space_gap(const Point& p) {
    const Lanes above = larger(p.z, 0.0f);
    return above * above;
}

inline Lanes bounds_gap(const Point& p, const float* low, const float* high) {
    const Point out{larger(larger(Lanes(low[0]) - p.x, p.x - high[0]), 0.0f),
                    larger(larger(Lanes(low[1]) - p.y, p.y - high[1]), 0.0f),
                    larger(larger(Lanes(low[2]) - p.z, p.z - high[2]), 0.0f)};
    return squared(out);
}

// From the begin of an edge to the point: `off`.
inline Lanes edge_gap(const Point& off, const float* edge, float per_squared) {
    const Lanes along = (off.x * edge[0] + off.y * edge[1] + off.z * edge[2]) * per_squared;
    const Lanes share = smaller(larger(along, 0.0f), 1.0f);
    return squared(Point{off.x - share * edge[0], off.y - share * edge[1], off.z - share * edge[2]});
}

// The nearest of the three edges, and of the face where the point is above it.
inline Lanes triangle_gap(const Point& p, const TriangleView& triangle) {
    const float* n = triangle.normal;
    Lanes nearest(0.0f), outside(0.0f);
    for (int i = 0; i < 3; ++i) {
        const float *corner = triangle.corner[i], *inward = triangle.inward[i];
        const Point off = p - Point{corner[0], corner[1], corner[2]};
        const Lanes gap = edge_gap(off, triangle.edge[i], triangle.per_squared[i]);
        nearest = i == 0 ? gap : smaller(nearest, gap);
        outside = larger(outside, Lanes(0.0f) - (off.x * inward[0] + off.y * inward[1] + off.z * inward[2]));
    }
    const float* a = triangle.corner[0];
    const Lanes height = (p.x - a[0]) * n[0] + (p.y - a[1]) * n[1] + (p.z - a[2]) * n[2];
    const bool has_area = n[0] != 0.0f || n[1] != 0.0f || n[2] != 0.0f;
    return has_area ? select(outside > 0.0f, nearest, smaller(height * height, nearest)) : nearest;
}

// What the cells promise at least: below 0 inside the solid, 0 where they promise nothing.
inline Lanes promised_gap(const MeshView& mesh, const Point& p) {
    float at[3][kLanes], promise[kLanes];
    const Point scaled{(p.x - mesh.low[0]) * mesh.per_cell, (p.y - mesh.low[1]) * mesh.per_cell,
                       (p.z - mesh.low[2]) * mesh.per_cell};
    store(scaled.x, at[0]);
    store(scaled.y, at[1]);
    store(scaled.z, at[2]);
    for (int i = 0; i < kLanes; ++i) {
        int32_t index = 0;
        bool is_in = true;
        for (int axis = 2; axis >= 0; --axis) {
            is_in = is_in && at[axis][i] >= 0.0f && at[axis][i] < static_cast<float>(mesh.size[axis]);
            index = index * mesh.size[axis] + (is_in ? static_cast<int32_t>(at[axis][i]) : 0);
        }
        promise[i] = is_in ? mesh.cells[index] : 0.0f;
    }
    return load(promise);
}

// The cells first; the triangles only for lanes of which the cells cannot say that they are beyond `limit`.
inline Lanes mesh_gap(const MeshView& mesh, const Point& p, const Lanes& limit) {
    const Lanes promise = promised_gap(mesh, p);
    const Mask is_inside = Lanes(0.0f) > promise;
    const Mask is_clear = promise > limit;
    Lanes nearest = select(is_clear, promise * promise, limit * limit + 1.0f);
    const uint32_t decided = bits(is_inside) | bits(is_clear);
    if (decided != kAllLanes) {
        for (int32_t i = 0; i < mesh.box_count;) {
            const BoxView& box = mesh.boxes[i];
            const uint32_t within = ~bits(bounds_gap(p, box.low, box.high) > smaller(nearest, limit * limit));
            const bool is_wanted = (within & ~decided & kAllLanes) != 0;
            for (int32_t k = 0; is_wanted && k < box.count; ++k) {
                nearest = smaller(triangle_gap(p, mesh.triangles[box.first + k]), nearest);
            }
            i = is_wanted ? i + 1 : box.skip;
        }
    }
    return select(is_inside, 0.0f, nearest);
}

// `limit`: from where on the distance does not matter any more.
inline Lanes squared_gap(const ObstacleView& obstacle, const Point& centre, const Lanes& limit) {
    const float* shift = obstacle.pose + 9;
    const Point p = obstacle.is_turned != 0 ? placed(obstacle.pose, centre)
                                            : Point{centre.x + shift[0], centre.y + shift[1], centre.z + shift[2]};
    switch (obstacle.shape) {
        case ShapeKind::kCylinder:
            return cylinder_gap(p, obstacle.size);
        case ShapeKind::kHalfSpace:
            return half_space_gap(p);
        case ShapeKind::kMesh:
            return mesh_gap(*obstacle.mesh, p, limit);
        default:
            return box_gap(p, obstacle.size);
    }
}

}  // namespace
}  // namespace gemelo
