#include "chunk.h"

namespace gemelo {
namespace {

// One step; chosen: a pose told in whole steps lies within half a step of the path.
constexpr int64_t kStartToleranceQ8 = 256;

Verdict refusal(Code code, uint8_t joint, uint16_t k, int32_t value, int32_t limit) {
    return Verdict{code, joint, k, value, limit};
}

Verdict check_knot(const Knot& knot, uint16_t k, const KnotRules& rules) {
    for (uint8_t j = 0; j < rules.joints; ++j) {
        const JointLimits& limits = rules.limits[j];
        const int32_t p = knot.position[j], v = knot.velocity[j];
        if (p > limits.upper_q8) return refusal(Code::PositionLimit, j, k, p, limits.upper_q8);
        if (p < limits.lower_q8) return refusal(Code::PositionLimit, j, k, p, limits.lower_q8);
        if (v > limits.velocity_q8) return refusal(Code::VelocityLimit, j, k, v, limits.velocity_q8);
        if (v < -limits.velocity_q8) return refusal(Code::VelocityLimit, j, k, v, -limits.velocity_q8);
    }
    return Verdict{};
}

Verdict check_rest(const Knot& knot, uint16_t k, uint8_t joints) {
    for (uint8_t j = 0; j < joints; ++j)
        if (knot.velocity[j] != 0) return refusal(Code::NotAtRest, j, k, knot.velocity[j], 0);
    return Verdict{};
}

Verdict check_start(const Knot& knot, const Knot& present, uint8_t joints) {
    for (uint8_t j = 0; j < joints; ++j) {
        const int64_t away = static_cast<int64_t>(knot.position[j]) - present.position[j];
        if (away > kStartToleranceQ8 || away < -kStartToleranceQ8)
            return refusal(Code::StartMismatch, j, 0, knot.position[j], present.position[j]);
    }
    return check_rest(knot, 0, joints);
}

Verdict check_between(const Knot& from, const Knot& to, uint16_t k, const KnotRules& rules) {
    for (uint8_t j = 0; j < rules.joints; ++j) {
        const Span span{from.position[j], from.velocity[j], to.position[j], to.velocity[j], to.dt_us};
        Verdict verdict = check_span(span, rules.limits[j]);
        if (verdict.is_ok()) continue;
        verdict.joint = j;
        verdict.knot = k;
        return verdict;
    }
    return Verdict{};
}

}  // namespace

bool Chunk::has_right_size() const {
    const size_t knot_size = static_cast<size_t>(joints()) * 8;
    return knots() >= 1 && knots() <= kMaxKnots && frame_.size == kChunkHeaderSize + knots() * knot_size;
}

void Chunk::read_knot(uint16_t k, Knot* knot) const {
    const size_t n = joints();
    const uint8_t* at = frame_.bytes + kChunkHeaderSize + k * n * 8;
    for (size_t j = 0; j < n; ++j) {
        knot->position[j] = load_i32(at + 4 * j);
        knot->velocity[j] = load_i32(at + 4 * (n + j));
    }
    knot->dt_us = dt_us();
}

Verdict check_knots(const Chunk& chunk, const KnotRules& rules, const Knot& before) {
    const uint32_t dt = chunk.dt_us();
    if (dt < kMinDtUs || dt > kMaxDtUs) {
        const uint32_t bound = dt < kMinDtUs ? kMinDtUs : kMaxDtUs;
        const int32_t value = dt > INT32_MAX ? INT32_MAX : static_cast<int32_t>(dt);
        return refusal(Code::BadDt, kNoJoint, 0, value, static_cast<int32_t>(bound));
    }
    Knot from = before, knot;
    for (uint16_t k = 0; k < chunk.knots(); ++k) {
        chunk.read_knot(k, &knot);
        const bool starts = k == 0 && chunk.is_first();
        Verdict verdict = check_knot(knot, k, rules);
        if (verdict.is_ok())
            verdict = starts ? check_start(knot, before, rules.joints) : check_between(from, knot, k, rules);
        if (!verdict.is_ok()) return verdict;
        from = knot;
    }
    if (!chunk.is_last()) return Verdict{};
    return check_rest(knot, static_cast<uint16_t>(chunk.knots() - 1), rules.joints);
}

}  // namespace gemelo
