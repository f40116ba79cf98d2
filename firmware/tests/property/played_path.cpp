#include "played_path.h"

#include <algorithm>

namespace property {

void PlayedPath::begin(const rig::ChunkSpec& first) {
    *this = PlayedPath{};
    start_ = end_ = first.rows.front();
    add(first);
}

void PlayedPath::add(const rig::ChunkSpec& chunk) {
    for (size_t k = chunk.first || chunk.replacing ? 1 : 0; k < chunk.rows.size(); ++k) {
        spans_.push_back(Span{end_us(), chunk.dt_to(k), end_, chunk.rows[k]});
        end_ = chunk.rows[k];
    }
}

void PlayedPath::replace(const rig::ChunkSpec& chunk) {
    while (!spans_.empty() && spans_.back().begin_us >= chunk.replacing->from_us) spans_.pop_back();
    end_ = spans_.empty() ? start_ : spans_.back().to;
    add(chunk);
}

bool PlayedPath::seek(uint64_t play_us) {
    play_us_ = play_us;
    shortest_dt_ = 1;
    while (at_ < spans_.size()) {
        const Span& span = spans_[at_];
        shortest_dt_ = std::min(shortest_dt_, span.dt_us * 1e-6);
        if (play_us <= span.begin_us + span.dt_us) return true;
        ++at_;
    }
    return play_us <= end_us();
}

// The cubic Hermite of PROTOCOL.md.
PlayedPath::Place PlayedPath::evaluate(uint8_t joint) const {
    if (at_ >= spans_.size()) return Place{end_.position[joint] / 256.0, 0};
    const Span& span = spans_[at_];
    const double dt = span.dt_us * 1e-6, u = static_cast<double>(play_us_ - span.begin_us) / span.dt_us;
    const double p0 = span.from.position[joint] / 256.0, d = span.to.position[joint] / 256.0 - p0;
    const double m0 = span.from.velocity[joint] / 256.0 * dt, m1 = span.to.velocity[joint] / 256.0 * dt;
    const double c2 = 3 * d - 2 * m0 - m1, c3 = m0 + m1 - 2 * d;
    return Place{p0 + u * (m0 + u * (c2 + u * c3)), (m0 + u * (2 * c2 + u * 3 * c3)) / dt};
}

}  // namespace property
