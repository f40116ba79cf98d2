#include "steered.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace rig {
namespace {

constexpr double kAcceleration = 3000;  // [steps/s^2]
constexpr uint32_t kNearUs = 20000, kTailUs = 40000;

int32_t q8(double value) { return static_cast<int32_t>(std::lround(value * 256)); }

// At a constant acceleration, towards these velocities.
Row next(const Row& from, const double (&velocity)[2], uint32_t dt_us) {
    Row to = from;
    const double dt = dt_us * 1e-6;
    for (size_t j = 0; j < 2; ++j) {
        const double before = from.velocity[j] / 256.0;
        const double after = std::clamp(velocity[j], before - kAcceleration * dt, before + kAcceleration * dt);
        to.velocity[j] = q8(after);
        to.position[j] = from.position[j] + q8((before + after) / 2 * dt);
    }
    return to;
}

bool stands(const Row& row) { return row.velocity[0] == 0 && row.velocity[1] == 0; }

}  // namespace

Steered::Steered(Rig& rig, uint32_t stream) : rig_(rig), stream_(stream), rows_{Row{{0, 0}, {0, 0}}}, times_us_{0} {
    for (uint8_t j = 0; j < 2; ++j) rows_[0].position[j] = rig.steps(j) * 256;
}

uint64_t Steered::played_us() const {
    const gemelo::Point& point = rig_.device.machine().present();
    return point.stream == stream_ ? point.play_us : 0;
}

ChunkSpec Steered::message(double v0, double v1, size_t near, uint64_t ahead_us) {
    const auto at = std::lower_bound(times_us_.begin(), times_us_.end(), played_us() + ahead_us);
    return message_from(std::min(static_cast<size_t>(at - times_us_.begin()), times_us_.size() - 1), v0, v1, near);
}

ChunkSpec Steered::message_from(size_t knot, double v0, double v1, size_t near) {
    ChunkSpec chunk;
    chunk.stream = stream_;
    chunk.seq = next_seq_;
    chunk.first = next_seq_ == 0;
    chunk.dt_us = kNearUs;
    chunk.rows = {rows_[knot]};
    for (size_t i = 0; i < near; ++i) chunk.rows.push_back(next(chunk.rows.back(), {v0, v1}, kNearUs));
    do chunk.rows.push_back(next(chunk.rows.back(), {0, 0}, kTailUs));
    while (!stands(chunk.rows.back()));
    chunk.replacing = Replacing{times_us_[knot], static_cast<uint16_t>(chunk.rows.size() - 1 - near), kTailUs};
    return chunk;
}

Ack Steered::send(const ChunkSpec& chunk) {
    const Ack ack = rig_.send(chunk);
    if (ack.code != gemelo::Code::Ok) return ack;
    next_seq_ = chunk.seq + 1;
    uint64_t time_us = chunk.replacing ? chunk.replacing->from_us : end_us();
    while (!times_us_.empty() && times_us_.back() > time_us) times_us_.pop_back();
    rows_.resize(times_us_.size());
    for (size_t k = chunk.replacing ? 1 : 0; k < chunk.rows.size(); ++k) {
        rows_.push_back(chunk.rows[k]);
        times_us_.push_back(time_us += chunk.dt_to(k));
    }
    return ack;
}

double Steered::position(size_t joint, uint64_t play_us) const {
    const auto after = std::upper_bound(times_us_.begin(), times_us_.end(), play_us);
    if (after == times_us_.end()) return rows_.back().position[joint] / 256.0;
    const size_t i = static_cast<size_t>(after - times_us_.begin());
    const double dt = static_cast<double>(times_us_[i] - times_us_[i - 1]) * 1e-6;
    const double u = static_cast<double>(play_us - times_us_[i - 1]) * 1e-6 / dt;
    const double p0 = rows_[i - 1].position[joint] / 256.0, d = rows_[i].position[joint] / 256.0 - p0;
    const double m0 = rows_[i - 1].velocity[joint] / 256.0 * dt, m1 = rows_[i].velocity[joint] / 256.0 * dt;
    return p0 + u * (m0 + u * ((3 * d - 2 * m0 - m1) + u * (m0 + m1 - 2 * d)));
}

void SteeredWatch::look(Rig& rig, const Steered& path) {
    for (uint8_t j = 0; j < 2; ++j) {
        std::vector<double>& p = positions_[j];
        p.push_back(rig.path(j));
        // play_us is cut to whole microseconds; at 4000 steps/s that is 0.004 steps.
        farthest_ = std::max(farthest_, std::fabs(p.back() - path.position(j, path.played_us())));
        const auto velocity = [&p](size_t ago) { return (p[p.size() - 1 - ago] - p[p.size() - 2 - ago]) * 1000.0; };
        if (p.size() < kSpan + 2) continue;
        fastest_ = std::max(fastest_, std::fabs(velocity(0)));
        hardest_ = std::max(hardest_, std::fabs(velocity(0) - velocity(kSpan)) * 1000.0 / kSpan);
    }
}

void SteeredWatch::run_ms(Rig& rig, const Steered& path, uint32_t ms, bool silent) {
    for (uint32_t i = 0; i < ms; ++i) {
        rig.run_ms(1, silent);
        look(rig, path);
    }
}

void SteeredWatch::expect_good(Rig& rig) const {
    EXPECT_LE(farthest_, 0.006) << "steps off the path";
    EXPECT_LE(fastest_, 4000 * 1.01) << "steps/s";
    EXPECT_LE(hardest_, 4000 * 1.1) << "steps/s^2, over 4 ms";
    EXPECT_LE(rig.device.machine().max_slot_error_q8(), 128u);
}

}  // namespace rig
