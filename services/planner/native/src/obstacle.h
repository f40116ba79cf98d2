// One solid: an obstacle in the arm's base, or what a link is made of in the link's frame.
#pragma once

#include <memory>

#include "mesh.h"
#include "sphere_tree.h"

namespace gemelo {

struct Obstacle {
    ShapeKind shape;
    double pose[12];  // of the obstacle in the base, or of the solid in its part's frame
    double size[3];   // as in ObstacleView
    double rounding;
    uint64_t touching;
    std::shared_ptr<const TriangleMesh> mesh;
};

// With its pose inverted, and larger by what floats lose on something so big or so far away.
inline ObstacleView view_of(const Obstacle& obstacle) {
    ObstacleView view{};
    const double* pose = obstacle.pose;
    double far =
        std::hypot(pose[9], pose[10], pose[11]) + std::hypot(obstacle.size[0], obstacle.size[1], obstacle.size[2]);
    if (obstacle.mesh) far += obstacle.mesh->radius();
    view.shape = obstacle.shape;
    view.rounding = rounded_up(obstacle.rounding + 1e-6 * far);
    view.touching = obstacle.touching;
    view.mesh = obstacle.mesh ? &obstacle.mesh->view() : nullptr;
    for (int row = 0; row < 3; ++row) {
        double shift = 0.0;
        for (int column = 0; column < 3; ++column) {
            view.pose[3 * row + column] = static_cast<float>(pose[3 * column + row]);
            shift -= pose[3 * column + row] * pose[9 + column];
        }
        view.pose[9 + row] = static_cast<float>(shift);
        view.size[row] = static_cast<float>(obstacle.size[row]);
        for (int column = 0; column < 3; ++column) {
            if (view.pose[3 * row + column] != (row == column ? 1.0f : 0.0f)) view.is_turned = 1;
        }
    }
    return view;
}

inline Sphere around(const Obstacle& obstacle, double rounding) {
    const double* size = obstacle.size;
    double radius = std::hypot(size[0], size[1], size[2]);
    if (obstacle.shape == ShapeKind::kCylinder) radius = std::hypot(size[0], size[2]);
    if (obstacle.mesh) radius = obstacle.mesh->radius();
    return {obstacle.pose[9], obstacle.pose[10], obstacle.pose[11], radius + rounding};
}

}  // namespace gemelo
