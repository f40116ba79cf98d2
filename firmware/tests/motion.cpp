#include "motion.h"

#include <algorithm>
#include <cmath>

namespace rig {
namespace {

int32_t q8(double value) { return static_cast<int32_t>(std::lround(value * 256.0)); }

}  // namespace

double Move::position(double t) const {
    const double x = std::clamp(t / duration, 0.0, 1.0);
    return from + (to - from) * x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
}

double Move::velocity(double t) const {
    const double x = std::clamp(t / duration, 0.0, 1.0);
    return (to - from) / duration * 30.0 * x * x * (1.0 - 2.0 * x + x * x);
}

size_t Motion::knots() const { return static_cast<size_t>(std::ceil(duration() / dt - 1e-9)) + 1; }

Row Motion::row(size_t i) const {
    Row row;
    for (const Move& move : joints) {
        const double t = static_cast<double>(i) * dt;
        row.position.push_back(q8(move.position(t)));
        row.velocity.push_back(i + 1 == knots() ? 0 : q8(move.velocity(t)));
    }
    return row;
}

ChunkSpec Motion::chunk(size_t begin, size_t end, uint32_t seq, uint32_t stream) const {
    ChunkSpec chunk;
    chunk.stream = stream;
    chunk.seq = seq;
    chunk.first = begin == 0;
    chunk.last = end == knots();
    chunk.dt_us = static_cast<uint32_t>(std::lround(dt * 1e6));
    for (size_t i = begin; i < end; ++i) chunk.rows.push_back(row(i));
    return chunk;
}

double Motion::played(size_t joint, double play_s) const {
    const size_t i = std::min(static_cast<size_t>(play_s / dt), knots() - 2);
    const Row a = row(i), b = row(i + 1);
    const double u = std::clamp((play_s - static_cast<double>(i) * dt) / dt, 0.0, 1.0);
    const double p0 = a.position[joint] / 256.0, p1 = b.position[joint] / 256.0;
    const double m0 = a.velocity[joint] / 256.0 * dt, m1 = b.velocity[joint] / 256.0 * dt;
    return p0 + u * (m0 + u * ((3 * (p1 - p0) - 2 * m0 - m1) + u * (m0 + m1 - 2 * (p1 - p0))));
}

Motion quintic(const std::vector<double>& from, const std::vector<double>& to, double dt) {
    double duration = 2 * dt;
    for (size_t j = 0; j < from.size(); ++j) {
        const double distance = std::fabs(to[j] - from[j]);
        duration = std::max({duration, 1.875 * distance / 4000.0, std::sqrt(5.7736 * distance / 4000.0)});
    }
    Motion motion;
    motion.dt = dt;
    duration = std::ceil(duration / dt) * dt;
    for (size_t j = 0; j < from.size(); ++j) motion.joints.push_back(Move{from[j], to[j], duration});
    return motion;
}

void Feeder::feed(Rig& rig) {
    const double played_s = static_cast<double>(rig.device.machine().present().play_us) * 1e-6;
    while (!is_done()) {
        const size_t end = std::min(next_ + chunk_knots_, motion_.knots());
        const bool is_due = next_ == 0 || static_cast<double>(next_) * motion_.dt < played_s + lead_s_;
        if (!is_due) return;
        if (rig.send(motion_.chunk(next_, end, seq_, stream_)).code != gemelo::Code::Ok) return;
        next_ = end;
        ++seq_;
    }
}

}  // namespace rig
