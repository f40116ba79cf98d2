// Input and output of the check: plain records without functions, so that it can be compiled for several processors.
//
// Lengths in m, angles in rad. A rigid transform is 12 floats: the 3 x 3 rotation by rows, then the translation.
#pragma once

#include <stdint.h>

namespace gemelo {

constexpr int kLanes = 8;  // standard: floats in a register of AVX2
constexpr uint32_t kAllLanes = (1u << kLanes) - 1;
constexpr int kMaxDof = 16;          // chosen: joints of an arm, with room
constexpr int kMaxFrames = 32;       // chosen: the base and one for each moving joint, followers included
constexpr int kMaxParts = 64;        // standard: links and attached objects are bits of ObstacleView::touching
constexpr float kMostTurn = 100.0f;  // [rad] chosen: joint values beyond it lose precision in a float

// A frame that a joint moves: its z is the joint's axis. Frame 0 is the base.
struct FrameView {
    int32_t parent;
    int32_t drive;  // the column of the joint values that moves it
    int32_t slides;
    float multiplier, offset;  // of a joint that follows another; 1 and 0 otherwise
    float fixed[12];           // from the parent's frame at joint value 0
};

// A sphere around all that comes after it up to `skip`; one that has nothing inside (`skip` is the next) is the cover's
// own.
struct NodeView {
    float x, y, z, radius;
    int32_t skip;
    int32_t item;  // of a leaf: which of the things that the tree was built of
};

enum class ShapeKind : int32_t {
    kRoundedBox,  // half sizes and a radius: sphere, capsule along z, box
    kCylinder,    // along z: size = {radius, -, half length}
    kHalfSpace,   // solid where z <= 0
    kMesh,
};

struct TriangleView {
    float corner[3][3];
    float normal[3];       // of length 1; zeros where the triangle has no area
    float edge[3][3];      // from each corner to the next
    float per_squared[3];  // 1 by the square of each edge's length; 0 where it has none
    float inward[3][3];    // across each edge into the triangle, as long as the edge
};

// An axis-aligned box around the triangles first .. first + count; inner ones have count 0.
struct BoxView {
    float low[3], high[3];
    int32_t skip, first, count;
};

// Triangles, and cells that say how far at least the surface is from any point in them; below 0: inside the solid.
struct MeshView {
    const BoxView* boxes;
    const TriangleView* triangles;
    const float* cells;
    int32_t box_count;
    int32_t size[3];
    float low[3], cell, per_cell;  // the grid's corner [m], a cell's edge [m] and its inverse
};

struct ObstacleView {
    ShapeKind shape;
    int32_t is_turned;  // 0: its axes are those of the base, as of most tables, walls and shelves
    float pose[12];     // from the base into the obstacle's own frame
    float size[3];
    float rounding;     // [m] radius and padding, added to the shape on all sides
    uint64_t touching;  // bit for every part that may touch it
    const MeshView* mesh;
};

// A link or an attached object: spheres in a frame, and the solids that they cover.
struct PartView {
    const NodeView* nodes;
    const ObstacleView* solids;  // their poses: from the part's frame into their own
    int32_t solid_count;
    int32_t frame;
};

constexpr int kMostLevels = 12;

// `count` cells along one joint's values, from `low` on, `scale` for each unit; with `is_turn` they go around.
struct TableAxisView {
    int32_t drive, count, is_turn;
    float low, scale;
};

// How far two parts are apart at least, by the cell that both joint values are in; every level has the least of two by
// two cells of the one before, by rows.
struct TableView {
    const float* cells;
    TableAxisView axes[2];
    int32_t offsets[kMostLevels];
    int32_t level_count;
    float least;  // of all
};

// Parts that may not touch: the spheres of the first against the solids of the second.
struct PairView {
    int32_t first, second;
    int32_t common = 0;                // the last frame that carries both
    const TableView* table = nullptr;  // null: only the spheres can tell
};

// How far at most a part, or two together, move [m] while the path's parameter goes on by 1.
struct MotionView {
    float travel;
    float bend;  // half the most that their velocity changes by meanwhile
};

struct WorldView {
    const FrameView* frames;
    const PartView* parts;
    const PairView* pairs;
    const ObstacleView* obstacles;
    const NodeView* tree;  // spheres around the bounded obstacles; its leaves' items are obstacles
    const int32_t* unbounded;
    int32_t frame_count, part_count, pair_count, tree_count, unbounded_count, obstacle_count;
};

// Two parts, or a part and kMaxParts + an obstacle; -1: none.
struct ContactView {
    int32_t first = -1, second = -1;
};

struct CheckQuery {
    const float* joints;            // [dof][kLanes]
    const float* half;              // [kLanes] of the curve's parameter that each lane stands for, on both sides
    const float* steps;             // null, or [dof][kLanes]: the way of each joint value over `half`, from its rate
    const float* slack;             // [kLanes] of `half`, by how much at most the way differs from that
    const MotionView* part_motion;  // [parts], [pairs]
    const MotionView* pair_motion;
    float margin;           // [m] that must stay free
    uint32_t lanes;         // which lanes matter
    bool first_hit_is_all;  // whether one lane's hit ends the question
    uint8_t* marks;  // null, or [parts][kMaxParts + obstacles]: all pairs near in a lane that matters are set to 1
    // What is asked about first, for it has mostly been found before: whether these touch, and what is near these.
    ContactView touching = {}, near = {};
    // [dof][kLanes]: how far at most each joint value goes within a lane's stretch, to either side; null where none
    // moves.
    const float* ways = nullptr;
};

struct CheckResult {
    uint32_t hits;          // lanes that are nearer than the margin
    uint32_t near;          // lanes that are nearer than the margin and the motion within `half`
    int32_t first, second;  // the parts of the newest contact; an obstacle is kMaxParts + its index
};

using Check = void (*)(const WorldView&, const CheckQuery&, CheckResult&);
using Place = void (*)(const WorldView&, const float* joints, float* centres);

// One build of the check.
struct Kernel {
    const char* name;
    Check check;
    Place place;  // the leaves' centres [leaf][3][kLanes] in the base, in the parts' order
};

extern const Kernel kPlainKernel, kVectorKernel, kAvx2Kernel;

}  // namespace gemelo
