#include "stream.h"

#include "bytes.h"
#include "frame.h"

using namespace gemelo;

namespace {

constexpr int64_t kN = kLastKnot;

// The quintic d u^3 (10 - 15 u + 6 u^2) at u = i / kN, in Q24.8 steps.
int32_t position_q8(int32_t from, int32_t distance, int64_t i) {
    const int64_t shape = i * i * i * (10 * kN * kN - 15 * kN * i + 6 * i * i);
    return static_cast<int32_t>(from * 256 + distance * 256 * shape / (kN * kN * kN * kN * kN));
}

// Its derivative d / T 30 u^2 (1 - u)^2, in Q24.8 steps/s.
int32_t velocity_q8(int32_t distance, int64_t i) {
    const int64_t shape = 30 * i * i * (kN - i) * (kN - i);
    return static_cast<int32_t>(distance * 256 * shape / (kN * kN * kN * kN) * (1000000 / kDtUs) / kN);
}

Wire header(FrameType type, uint8_t joints, uint32_t boot_id) {
    Wire wire{};
    write_header(wire.bytes, type, joints, boot_id);
    wire.size = kHeaderSize;
    return wire;
}

void add_u16(Wire* wire, uint16_t value) {
    store_u16(wire->bytes + wire->size, value);
    wire->size += 2;
}

void add_u32(Wire* wire, uint32_t value) {
    store_u32(wire->bytes + wire->size, value);
    wire->size += 4;
}

void add_u64(Wire* wire, uint64_t value) {
    store_u64(wire->bytes + wire->size, value);
    wire->size += 8;
}

uint16_t knots_from(uint16_t first, uint16_t most) {
    const int left = kLastKnot + 1 - first;
    return left < most ? static_cast<uint16_t>(left) : most;
}

Wire sealed(Wire wire) {
    wire.size = seal_frame(wire.bytes, wire.size);
    return wire;
}

}  // namespace

Wire Move::begin(uint16_t first, uint16_t knots, uint32_t seq, uint16_t flags) const {
    Wire wire = header(FrameType::Traj, joints, kBoot);
    add_u32(&wire, stream);
    add_u32(&wire, seq);
    add_u64(&wire, UINT64_MAX);
    add_u32(&wire, kDtUs);
    add_u16(&wire, knots);
    const int last = first + knots > kLastKnot ? kFlagLast : 0;
    add_u16(&wire, static_cast<uint16_t>(flags | (first == 0 ? kFlagFirst : 0) | last));
    return wire;
}

Wire Move::end(Wire wire, uint16_t first, uint16_t knots) const {
    for (int64_t i = first; i < first + knots; ++i) {
        for (uint8_t j = 0; j < joints; ++j)
            add_u32(&wire, static_cast<uint32_t>(position_q8(from[j], distance[j], i)));
        for (uint8_t j = 0; j < joints; ++j) add_u32(&wire, static_cast<uint32_t>(velocity_q8(distance[j], i)));
    }
    return sealed(wire);
}

Wire Move::chunk(uint16_t first, uint32_t seq) const {
    const uint16_t knots = knots_from(first, kChunkKnots);
    return end(begin(first, knots, seq, 0), first, knots);
}

Wire Move::replacement(uint16_t first, uint32_t seq) const {
    const uint16_t knots = knots_from(first, kReplacingKnots + 1);
    Wire wire = begin(first, knots, seq, kFlagReplace);
    add_u64(&wire, first * kDtUs);
    add_u32(&wire, kDtUs);
    add_u32(&wire, 1);  // the tail, and 0
    return end(wire, first, knots);
}

Wire command(Command command, uint32_t id, uint16_t argument) {
    Wire wire = header(FrameType::Cmd, 0, kBoot);
    add_u32(&wire, id);
    add_u64(&wire, UINT64_MAX);
    add_u32(&wire, static_cast<uint32_t>(command) | static_cast<uint32_t>(argument) << 16);
    return sealed(wire);
}

Wire heartbeat(uint32_t counter) {
    Wire wire = header(FrameType::Heartbeat, 0, 0);
    add_u32(&wire, 1);
    add_u32(&wire, counter);
    return sealed(wire);
}
