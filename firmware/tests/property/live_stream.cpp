#include "live_stream.h"

#include <algorithm>

using namespace gemelo;

namespace property {

LiveStream::LiveStream(const DeviceConfig& config, const std::vector<int32_t>& start, uint64_t seed)
    : config_(config), dice_(seed), knots_{Knot{0, rig::Row{start, std::vector<int32_t>(start.size())}}} {}

rig::ChunkSpec LiveStream::message(uint64_t from_us, bool ends) {
    const auto at =
        std::find_if(knots_.begin(), knots_.end() - 1, [from_us](const Knot& knot) { return knot.time_us >= from_us; });
    rig::ChunkSpec chunk = from(*at);
    const size_t near = chunk.rows.size() - chunk.replacing->tail;
    if (!ends && near > 1 && dice_.chance(0.1)) {  // ends at speed
        chunk.rows.resize(near);
        chunk.replacing->tail = 0;
    }
    chunk.last = ends;
    return chunk;
}

rig::ChunkSpec LiveStream::wrong_message(uint64_t played_us) {
    const Knot& newest = knots_.back();
    if (knots_.front().time_us < played_us && dice_.chance(0.5)) {
        const auto after = std::find_if(knots_.begin(), knots_.end(),
                                        [played_us](const Knot& knot) { return knot.time_us >= played_us; });
        return from(*(after - 1));
    }
    rig::ChunkSpec chunk = from(newest);
    const size_t joint = static_cast<size_t>(dice_.between(0, config_.joints - 1));
    std::vector<int32_t>& numbers = dice_.chance(0.5) ? chunk.rows[0].position : chunk.rows[0].velocity;
    numbers[joint] += dice_.chance(0.5) ? 1 : -1;
    return chunk;
}

rig::ChunkSpec LiveStream::from(const Knot& knot) {
    RandomPath path(config_, knot.row, static_cast<uint64_t>(dice_.between(0, INT64_MAX / 2)));
    rig::ChunkSpec chunk = path.steered();
    chunk.replacing->from_us = knot.time_us;
    return chunk;
}

void LiveStream::take(const rig::ChunkSpec& chunk) {
    uint64_t time_us = chunk.replacing->from_us;
    while (knots_.back().time_us > time_us) knots_.pop_back();
    for (size_t k = 1; k < chunk.rows.size(); ++k) knots_.push_back(Knot{time_us += chunk.dt_to(k), chunk.rows[k]});
    is_over_ = chunk.last;
}

bool LiveStream::rests() const {
    const std::vector<int32_t>& velocity = target().velocity;
    return std::all_of(velocity.begin(), velocity.end(), [](int32_t v) { return v == 0; });
}

}  // namespace property
