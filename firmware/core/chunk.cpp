#include "chunk.h"

namespace gemelo {
namespace {

// One step; chosen: a pose told in whole steps lies within half a step of the path.
constexpr int64_t kStartToleranceQ8 = 256;

Verdict refusal(Code code, uint8_t joint, uint16_t k, int32_t value, int32_t limit) {
    return Verdict{code, joint, k, value, limit};
}

Verdict check_range(int32_t value, int32_t lower, int32_t upper, Code code, uint8_t joint, uint16_t k) {
    if (value >= lower && value <= upper) return Verdict{};
    return refusal(code, joint, k, value, value > upper ? upper : lower);
}

Verdict check_knot(const Knot& knot, uint16_t k, const KnotRules& rules) {
    for (uint8_t j = 0; j < rules.joints; ++j) {
        const JointLimits& limits = rules.limits[j];
        Verdict verdict = check_range(knot.position[j], limits.lower_q8, limits.upper_q8, Code::PositionLimit, j, k);
        if (verdict.is_ok())
            verdict = check_range(knot.velocity[j], -limits.velocity_q8, limits.velocity_q8, Code::VelocityLimit, j, k);
        if (!verdict.is_ok()) return verdict;
    }
    return Verdict{};
}

Verdict check_dt(uint32_t dt) {
    if (dt >= kMinDtUs && dt <= kMaxDtUs) return Verdict{};
    const uint32_t bound = dt < kMinDtUs ? kMinDtUs : kMaxDtUs;
    const int32_t value = dt > INT32_MAX ? INT32_MAX : static_cast<int32_t>(dt);
    return refusal(Code::BadDt, kNoJoint, 0, value, static_cast<int32_t>(bound));
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

// What the spans to the knots of one dt are held against.
struct Bounds {
    uint32_t dt_us = 0;
    SpanBounds joint[kMaxJoints];

    void set_dt(uint32_t dt, const KnotRules& rules) {
        if (dt == dt_us) return;
        dt_us = dt;
        for (uint8_t j = 0; j < rules.joints; ++j) joint[j] = bounds_of(rules.limits[j], dt);
    }
};

Verdict check_between(const Knot& from, const Knot& to, uint16_t k, const KnotRules& rules, const Bounds& bounds) {
    for (uint8_t j = 0; j < rules.joints; ++j) {
        const Span span{from.position[j], from.velocity[j], to.position[j], to.velocity[j], to.dt_us};
        Verdict verdict = check_span(span, rules.limits[j], bounds.joint[j]);
        if (verdict.is_ok()) continue;
        verdict.joint = j;
        verdict.knot = k;
        return verdict;
    }
    return Verdict{};
}

}  // namespace

Chunk::Chunk(const Frame& frame)
    : frame_(frame),
      boot_id_(frame.boot_id()),
      stream_(load_u32(frame.bytes + 8)),
      seq_(load_u32(frame.bytes + 12)),
      dt_us_(load_u32(frame.bytes + 24)),
      expires_us_(load_u64(frame.bytes + 16)),
      knots_(load_u16(frame.bytes + 28)),
      flags_(load_u16(frame.bytes + 30)) {
    if (!is_replacement()) return;
    header_size_ = kChunkHeaderSize + kReplacementSize;
    if (frame.size < header_size_) return;
    from_us_ = load_u64(frame.bytes + kChunkHeaderSize);
    tail_dt_us_ = load_u32(frame.bytes + kChunkHeaderSize + 8);
    tail_ = load_u16(frame.bytes + kChunkHeaderSize + 12);
}

bool Chunk::has_right_size() const {
    const size_t knot_size = static_cast<size_t>(joints()) * 8;
    const uint16_t least = is_replacement() ? 2 : 1;
    if (knots() < least || knots() > kMaxKnots || frame_.size != header_size_ + knots() * knot_size) return false;
    return tail() < knots();
}

void Chunk::read_knot(uint16_t k, Knot* knot) const {
    const size_t n = joints();
    const uint8_t* at = frame_.bytes + header_size_ + k * n * 8;
    for (size_t j = 0; j < n; ++j) {
        knot->position[j] = load_i32(at + 4 * j);
        knot->velocity[j] = load_i32(at + 4 * (n + j));
    }
    knot->dt_us = k + tail() < knots() ? dt_us() : tail_dt_us();
}

bool Chunk::begins_with(const Knot& knot) const {
    Knot own;
    read_knot(0, &own);
    for (uint8_t j = 0; j < joints(); ++j)
        if (own.position[j] != knot.position[j] || own.velocity[j] != knot.velocity[j]) return false;
    return true;
}

// The velocities of the last knot are the last of the frame.
bool Chunk::ends_at_rest() const {
    for (size_t i = 1; i <= static_cast<size_t>(joints()) * 4; ++i)
        if (frame_.bytes[frame_.size - i] != 0) return false;
    return true;
}

Verdict check_knots(const Chunk& chunk, const KnotRules& rules, const Knot& before) {
    Verdict verdict = check_dt(chunk.dt_us());
    if (verdict.is_ok() && chunk.tail() != 0) verdict = check_dt(chunk.tail_dt_us());
    if (!verdict.is_ok()) return verdict;
    Bounds bounds;
    Knot knots[2];
    const Knot* from = &before;
    for (uint16_t k = chunk.is_first() ? 0 : chunk.begin(); k < chunk.knots(); ++k) {
        Knot& knot = knots[k % 2];
        chunk.read_knot(k, &knot);
        bounds.set_dt(knot.dt_us, rules);
        const bool starts = k == 0 && chunk.is_first();
        verdict = check_knot(knot, k, rules);
        if (verdict.is_ok())
            verdict = starts ? check_start(knot, before, rules.joints) : check_between(*from, knot, k, rules, bounds);
        if (!verdict.is_ok()) return verdict;
        from = &knot;
    }
    if (!chunk.is_last()) return Verdict{};
    return check_rest(*from, static_cast<uint16_t>(chunk.knots() - 1), rules.joints);
}

}  // namespace gemelo
