#include "random_path.h"

#include <algorithm>

using namespace gemelo;

namespace property {
namespace {

constexpr int kMostKnots = 30;
constexpr double kLongestDt = 0.25;

int64_t change_in(const JointConfig& limits, uint32_t dt_us) {
    return static_cast<int64_t>(limits.max_acceleration_q8) * dt_us / 1000000;
}

}  // namespace

RandomPath::RandomPath(const DeviceConfig& config, std::vector<int32_t> start, uint64_t seed)
    : RandomPath(config, rig::Row{start, std::vector<int32_t>(start.size())}, seed) {}

RandomPath::RandomPath(const DeviceConfig& config, const rig::Row& start, uint64_t seed)
    : dice_(seed), pace_(static_cast<int>(dice_.between(0, 3))) {
    for (uint8_t j = 0; j < config.joints; ++j) {
        const int32_t fastest = velocity_limit_q8(config, j);
        joints_.push_back(Joint{start.position[j], start.velocity[j], 0, config.joint[j], fastest});
        joints_.back().target = random_target(joints_.back());
    }
}

rig::ChunkSpec RandomPath::next() {
    rig::ChunkSpec chunk;
    chunk.dt_us = random_dt();
    chunk.first = is_first_;
    if (is_first_) chunk.rows.push_back(row());
    is_first_ = false;
    const size_t most = static_cast<size_t>(dice_.between(1, kMostKnots));
    while (chunk.rows.size() < most && !is_over_) {
        if (is_ending_ && stands() && !chunk.rows.empty()) break;
        add_row(chunk.dt_us, &chunk);
    }
    chunk.last = is_over_ = is_ending_ && stands();
    return chunk;
}

rig::ChunkSpec RandomPath::steered() {
    rig::ChunkSpec chunk;
    chunk.dt_us = random_dt();
    chunk.rows.push_back(row());
    for (int64_t near = dice_.between(0, 12); near > 0; --near) add_row(chunk.dt_us, &chunk);
    is_ending_ = true;
    chunk.replacing = rig::Replacing{0, 0, tail_dt()};
    do {
        add_row(chunk.replacing->tail_dt_us, &chunk);
        ++chunk.replacing->tail;
    } while (!stands());
    return chunk;
}

// One time step of all joints.
void RandomPath::add_row(uint32_t dt_us, rig::ChunkSpec* chunk) {
    for (Joint& joint : joints_) {
        if (dice_.chance(0.02)) joint.target = random_target(joint);
        move(joint, dt_us);
    }
    chunk->rows.push_back(row());
}

// At most some sixteen of them to rest.
uint32_t RandomPath::tail_dt() {
    double stop_us = 0;
    for (const Joint& joint : joints_)
        stop_us = std::max(stop_us, std::abs(1e6 * joint.v / joint.limits.max_acceleration_q8));
    return static_cast<uint32_t>(std::min(dice_.logarithmic(std::max(1000.0, stop_us / 16), 250000), 250000.0));
}

// 1 to 250 ms, another in every chunk; about 20 ms; 20 ms; short ones.
uint32_t RandomPath::random_dt() {
    switch (pace_) {
        case 0:
            return static_cast<uint32_t>(std::clamp(dice_.logarithmic(1000, 250000), 1000.0, 250000.0));
        case 1:
            return static_cast<uint32_t>(dice_.between(15000, 30000));
        case 2:
            return 20000;
        default:
            return static_cast<uint32_t>(dice_.between(1000, 12000));
    }
}

int64_t RandomPath::random_target(const Joint& joint) {
    if (dice_.chance(0.15)) return 0;
    const int64_t sign = dice_.chance(0.5) ? 1 : -1;
    if (dice_.chance(0.6)) return sign * joint.fastest;
    return sign * dice_.between(0, joint.fastest);
}

// One time step at a constant acceleration, which the cubic through the two knots has too but for their rounding.
void RandomPath::move(Joint& joint, uint32_t dt_us) {
    const int64_t change = change_in(joint.limits, dt_us);
    const int64_t target = is_ending_ ? 0 : joint.target;
    const auto after = [&joint, dt_us](int64_t v) {
        const int64_t way = (joint.v + v) * static_cast<int64_t>(dt_us);
        return joint.p + (way + (way >= 0 ? 1000000 : -1000000)) / 2000000;
    };
    int64_t v = std::clamp<int64_t>(target, joint.v - change, joint.v + change);
    if (!can_stop(joint, after(v), v)) v = std::clamp<int64_t>(0, joint.v - change, joint.v + change);
    joint.p = static_cast<int32_t>(after(v));
    joint.v = static_cast<int32_t>(v);
}

// Braking with steps of any length from there stays within the limits.
bool RandomPath::can_stop(const Joint& joint, int64_t p, int64_t v) const {
    const double speed = std::abs(static_cast<double>(v));
    const double way = speed * speed / (2.0 * joint.limits.max_acceleration_q8) + speed * kLongestDt / 2 + 256;
    const double end = static_cast<double>(p) + (v < 0 ? -way : way);
    return v == 0 || (end < joint.limits.upper_q8 && end > joint.limits.lower_q8);
}

bool RandomPath::stands() const {
    return std::all_of(joints_.begin(), joints_.end(), [](const Joint& joint) { return joint.v == 0; });
}

rig::Row RandomPath::row() const {
    rig::Row row;
    for (const Joint& joint : joints_) {
        row.position.push_back(joint.p);
        row.velocity.push_back(joint.v);
    }
    return row;
}

}  // namespace property
