// Forward kinematics: frames and points in eight configurations at once.
#pragma once

#include "trigonometry.h"

namespace gemelo {
namespace {

struct Point {
    Lanes x, y, z;
};

inline Point operator-(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Lanes dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Lanes squared(const Point& a) { return dot(a, a); }

// A rotation by rows, and a translation.
struct Placement {
    Lanes r[9];
    Point t;
};

inline Point turned(const Lanes* r, const Point& p) {
    return {r[0] * p.x + r[1] * p.y + r[2] * p.z, r[3] * p.x + r[4] * p.y + r[5] * p.z,
            r[6] * p.x + r[7] * p.y + r[8] * p.z};
}

inline Point placed(const Placement& at, float x, float y, float z) {
    const Point p = turned(at.r, {x, y, z});
    return {p.x + at.t.x, p.y + at.t.y, p.z + at.t.z};
}

inline Point centre_of(const Placement& at, const NodeView& node) { return placed(at, node.x, node.y, node.z); }

// By a transform that is the same in all lanes.
inline Point placed(const float* fixed, const Point& p) {
    return {p.x * fixed[0] + p.y * fixed[1] + p.z * fixed[2] + fixed[9],
            p.x * fixed[3] + p.y * fixed[4] + p.z * fixed[5] + fixed[10],
            p.x * fixed[6] + p.y * fixed[7] + p.z * fixed[8] + fixed[11]};
}

inline Placement compose(const Placement& at, const float* fixed) {
    Placement result;
    for (int row = 0; row < 9; row += 3) {
        for (int column = 0; column < 3; ++column) {
            result.r[row + column] =
                at.r[row] * fixed[column] + at.r[row + 1] * fixed[3 + column] + at.r[row + 2] * fixed[6 + column];
        }
    }
    result.t = placed(at, fixed[9], fixed[10], fixed[11]);
    return result;
}

// `other` as seen from `self`.
inline Placement relative(const Placement& self, const Placement& other) {
    Placement result;
    const Lanes inverse[9] = {self.r[0], self.r[3], self.r[6], self.r[1], self.r[4],
                              self.r[7], self.r[2], self.r[5], self.r[8]};
    for (int column = 0; column < 3; ++column) {
        const Point p = turned(inverse, {other.r[column], other.r[3 + column], other.r[6 + column]});
        result.r[column] = p.x;
        result.r[3 + column] = p.y;
        result.r[6 + column] = p.z;
    }
    result.t = turned(inverse, other.t - self.t);
    return result;
}

inline Placement identity() {
    Placement at;
    for (int i = 0; i < 9; ++i) at.r[i] = i % 4 == 0 ? 1.0f : 0.0f;
    at.t = {0.0f, 0.0f, 0.0f};
    return at;
}

// The joint's own motion, along or about its z.
inline void move(Placement& at, const FrameView& frame, const Lanes& value) {
    if (frame.slides) {
        at.t = {at.t.x + at.r[2] * value, at.t.y + at.r[5] * value, at.t.z + at.r[8] * value};
        return;
    }
    Lanes sine, cosine;
    sine_cosine(value, sine, cosine);
    for (int row = 0; row < 9; row += 3) {
        const Lanes x = at.r[row], y = at.r[row + 1];
        at.r[row] = x * cosine + y * sine;
        at.r[row + 1] = y * cosine - x * sine;
    }
}

inline Point operator+(const Point& a, const Point& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Point operator*(const Point& a, const Lanes& by) { return {a.x * by, a.y * by, a.z * by}; }
inline Point cross(const Point& a, const Point& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// How a frame moves while the joint values go their `steps`, to first order: what is at p goes by shift + turn x p.
struct Twist {
    Point turn, shift;
};

inline Twist operator-(const Twist& a, const Twist& b) { return {a.turn - b.turn, a.shift - b.shift}; }

// How far at most what is within `radius` of `centre` goes.
inline Lanes travel(const Twist& by, const Point& centre, float radius) {
    return square_root(squared(by.shift + cross(by.turn, centre))) + square_root(squared(by.turn)) * radius;
}

inline void twist_frames(const WorldView& world, const float* steps, const Placement* frames, Twist* twists) {
    twists[0] = {{0.0f, 0.0f, 0.0f}, {0.0f, 0.0f, 0.0f}};
    for (int i = 1; i < world.frame_count; ++i) {
        const FrameView& frame = world.frames[i];
        const Lanes step = load(steps + frame.drive * kLanes) * frame.multiplier;
        const Point along = Point{frames[i].r[2], frames[i].r[5], frames[i].r[8]} * step;
        twists[i] = twists[frame.parent];
        if (frame.slides) {
            twists[i].shift = twists[i].shift + along;
        } else {
            twists[i].turn = twists[i].turn + along;
            twists[i].shift = twists[i].shift + cross(frames[i].t, along);
        }
    }
}

inline void place_frames(const WorldView& world, const float* joints, Placement* frames) {
    frames[0] = identity();
    for (int i = 1; i < world.frame_count; ++i) {
        const FrameView& frame = world.frames[i];
        const Lanes value = load(joints + frame.drive * kLanes) * frame.multiplier + frame.offset;
        frames[i] = compose(frames[frame.parent], frame.fixed);
        move(frames[i], frame, value);
    }
}

}  // namespace
}  // namespace gemelo
