// A mesh as an obstacle: boxes around its triangles, and a grid that knows how far the surface is at least.
//
// Solid is what a closed surface encloses (the winding number's answer, Jacobson 2013); an open one is only a skin.
#pragma once

#include <array>
#include <numeric>
#include <vector>

#include "bad_model.h"
#include "distance_grid.h"
#include "views.h"

namespace gemelo {

class TriangleMesh {
  public:
    // Triangles' corners (n, 3, 3) [m].
    explicit TriangleMesh(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
        if (triangles_.empty()) throw BadModel("a mesh needs at least one triangle");
        std::vector<size_t> order(triangles_.size());
        std::iota(order.begin(), order.end(), 0);
        add(order, 0, order.size());
        grid_ = DistanceGrid(triangles_);
        for (const Triangle& triangle : triangles_) {
            for (const Vector& corner : triangle) radius_ = std::max(radius_, length(corner));
        }
        for (size_t i = 0; i < grid_.cells.size(); ++i) {
            if (grid_.kinds[i] == CellKind::kSolid) grid_.cells[i] = -1.0f;
        }
        view_ = {boxes_.data(), views_.data(), grid_.cells.data(), static_cast<int32_t>(boxes_.size()), {}, {}, 0, 0};
        for (size_t axis = 0; axis < 3; ++axis) {
            view_.size[axis] = grid_.size[axis];
            view_.low[axis] = static_cast<float>(grid_.low[axis]);
        }
        view_.cell = static_cast<float>(grid_.cell);
        view_.per_cell = static_cast<float>(1.0 / grid_.cell);
    }
    TriangleMesh(const TriangleMesh&) = delete;
    TriangleMesh& operator=(const TriangleMesh&) = delete;

    const MeshView& view() const { return view_; }
    double radius() const { return radius_; }  // around the mesh's own origin

  private:
    static constexpr size_t kLeaf = 4;  // triangles; chosen: a box costs about as much as that many

    void add(std::vector<size_t>& order, size_t begin, size_t end) {
        const size_t self = boxes_.size();
        boxes_.push_back(around(order, begin, end));
        if (end - begin <= kLeaf) {
            boxes_[self].first = static_cast<int32_t>(views_.size());
            boxes_[self].count = static_cast<int32_t>(end - begin);
            for (size_t i = begin; i < end; ++i) views_.push_back(view_of(triangles_[order[i]]));
        } else {
            const size_t middle = begin + (end - begin) / 2;
            const size_t axis = longest(boxes_[self]);
            const auto at = [&](size_t i) {
                return triangles_[i][0][axis] + triangles_[i][1][axis] + triangles_[i][2][axis];
            };
            std::nth_element(order.begin() + static_cast<long>(begin), order.begin() + static_cast<long>(middle),
                             order.begin() + static_cast<long>(end),
                             [&](size_t a, size_t b) { return at(a) != at(b) ? at(a) < at(b) : a < b; });
            add(order, begin, middle);
            add(order, middle, end);
        }
        boxes_[self].skip = static_cast<int32_t>(boxes_.size());
    }

    BoxView around(const std::vector<size_t>& order, size_t begin, size_t end) const {
        BoxView box{};
        for (size_t axis = 0; axis < 3; ++axis) {
            box.low[axis] = std::numeric_limits<float>::infinity();
            box.high[axis] = -box.low[axis];
            for (size_t i = begin; i < end; ++i) {
                for (const Vector& corner : triangles_[order[i]]) {
                    box.low[axis] = std::min(box.low[axis], static_cast<float>(corner[axis]));
                    box.high[axis] = std::max(box.high[axis], static_cast<float>(corner[axis]));
                }
            }
        }
        return box;
    }

    static size_t longest(const BoxView& box) {
        size_t axis = 0;
        for (size_t i = 1; i < 3; ++i) {
            if (box.high[i] - box.low[i] > box.high[axis] - box.low[axis]) axis = i;
        }
        return axis;
    }

    static TriangleView view_of(const Triangle& triangle) {
        TriangleView view{};
        const Vector normal = cross(minus(triangle[1], triangle[0]), minus(triangle[2], triangle[0]));
        const double twice_area = length(normal);
        for (size_t axis = 0; axis < 3; ++axis) {
            for (size_t i = 0; i < 3; ++i) view.corner[i][axis] = static_cast<float>(triangle[i][axis]);
            view.normal[axis] = twice_area > 1e-18 ? static_cast<float>(normal[axis] / twice_area) : 0.0f;
        }
        for (size_t i = 0; i < 3; ++i) add_edge(i, view);
        return view;
    }

    // From the corner `i` to the next: what every distance to the triangle needs.
    static void add_edge(size_t i, TriangleView& view) {
        const float *from = view.corner[i], *to = view.corner[(i + 1) % 3], *n = view.normal;
        float* edge = view.edge[i];
        for (size_t axis = 0; axis < 3; ++axis) edge[axis] = to[axis] - from[axis];
        const float squared = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2];
        view.per_squared[i] = squared > 0.0f ? 1.0f / squared : 0.0f;
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t next = (axis + 1) % 3, last = (axis + 2) % 3;
            view.inward[i][axis] = n[next] * edge[last] - n[last] * edge[next];
        }
    }

    std::vector<Triangle> triangles_;
    std::vector<BoxView> boxes_;
    std::vector<TriangleView> views_;
    DistanceGrid grid_;
    MeshView view_;
    double radius_ = 0.0;
};

}  // namespace gemelo
