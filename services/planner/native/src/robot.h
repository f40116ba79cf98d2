// The arm: frames that joints move, parts made of spheres, and how far a joint can carry a part.
#pragma once

#include <string>
#include <vector>

#include "obstacle.h"
#include "sphere_tree.h"

namespace gemelo {

struct Chain {
    std::vector<FrameView> frames;  // parents before children; the first is the base
    std::vector<double> travel;     // [m] a sliding joint can be away from 0; 0 for a turning one
    int32_t dof = 0;

    const FrameView& frame(int32_t index) const { return frames[static_cast<size_t>(index)]; }

    void require_sound() const {
        if (frames.empty() || frames.size() > kMaxFrames || travel.size() != frames.size()) {
            throw BadModel("an arm has 1 to " + std::to_string(kMaxFrames) + " frames, not " +
                           std::to_string(frames.size()));
        }
        if (dof < 1 || dof > kMaxDof) throw BadModel("an arm has 1 to 16 joint values, not " + std::to_string(dof));
        for (int32_t i = 1; i < static_cast<int32_t>(frames.size()); ++i) {
            if (frame(i).parent < 0 || frame(i).parent >= i) throw BadModel("a frame's parent must come before it");
            if (frame(i).drive < 0 || frame(i).drive >= dof) throw BadModel("a frame's joint value must exist");
        }
    }
};

// A link or an attached object.
struct Part {
    int32_t frame;
    std::vector<Sphere> spheres;   // in the frame
    std::vector<Obstacle> solids;  // that the balls cover
    std::vector<NodeView> nodes;
    std::vector<ObstacleView> solid_views;

    Part(int32_t of, std::vector<Sphere> cover, std::vector<Obstacle> covered)
        : frame(of), spheres(std::move(cover)), solids(std::move(covered)), nodes(SphereTree(spheres).take()) {
        if (spheres.empty() || solids.empty()) throw BadModel("a part needs at least one sphere and one solid");
        for (const Obstacle& solid : solids) solid_views.push_back(view_of(solid));
    }
};

// How far at most [m] a part moves for each unit of each frame's joint: [m/rad] or [m/m]; 0 where it does not move it.
//
// For a turning joint that is the longest path from its axis to a point of the part, over all positions of the joints
// between. Where the next axis is parallel, the path along the axis does not count (an arm of the SCARA kind).
inline std::vector<double> reaches(const Chain& chain, const Part& part) {
    std::vector<double> reach(chain.frames.size(), 0.0);
    double from_axis = 0.0, from_origin = 0.0;
    for (const Sphere& sphere : part.spheres) {
        from_axis = std::max(from_axis, std::hypot(sphere.x, sphere.y) + sphere.radius);
        from_origin = std::max(from_origin, std::hypot(sphere.x, sphere.y, sphere.z) + sphere.radius);
    }
    for (int32_t i = part.frame; i > 0; i = chain.frame(i).parent) {
        const FrameView& frame = chain.frame(i);
        const double travel = chain.travel[static_cast<size_t>(i)];
        reach[static_cast<size_t>(i)] = std::abs(frame.multiplier) * (frame.slides ? 1.0 : from_axis);
        const bool is_parallel = std::abs(frame.fixed[8]) > 1.0f - 1e-6f;
        const double aside = std::hypot(frame.fixed[9], frame.fixed[10]);
        from_axis = aside + (is_parallel ? from_axis + 1e-3 * from_origin : from_origin + travel);
        from_origin += travel + std::hypot(aside, frame.fixed[11]);
    }
    return reach;
}

}  // namespace gemelo
