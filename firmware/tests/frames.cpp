#include "frames.h"

#include "bytes.h"
#include "frame.h"

namespace rig {
namespace {

void add_u8(Bytes& bytes, uint8_t value) { bytes.push_back(value); }

void add_u16(Bytes& bytes, uint16_t value) {
    bytes.resize(bytes.size() + 2);
    gemelo::store_u16(&bytes[bytes.size() - 2], value);
}

void add_u32(Bytes& bytes, uint32_t value) {
    bytes.resize(bytes.size() + 4);
    gemelo::store_u32(&bytes[bytes.size() - 4], value);
}

void add_u64(Bytes& bytes, uint64_t value) {
    bytes.resize(bytes.size() + 8);
    gemelo::store_u64(&bytes[bytes.size() - 8], value);
}

Bytes header(gemelo::FrameType type, size_t joints, uint32_t boot_id) {
    Bytes bytes(gemelo::kHeaderSize);
    gemelo::write_header(bytes.data(), type, static_cast<uint8_t>(joints), boot_id);
    return bytes;
}

}  // namespace

Bytes build_update(gemelo::UpdateStep step, uint32_t session, uint32_t offset, const Bytes& content, uint32_t boot_id) {
    Bytes bytes(gemelo::kHeaderSize + 12);
    gemelo::write_header(bytes.data(), gemelo::FrameType::Update, 0, boot_id);
    gemelo::store_u32(&bytes[8], session);
    gemelo::store_u32(&bytes[12], offset);
    bytes[16] = static_cast<uint8_t>(step);
    bytes.insert(bytes.end(), content.begin(), content.end());
    return seal(bytes);
}

Bytes build_update_begin(uint32_t size, uint8_t digest) {
    Bytes content(4);
    gemelo::store_u32(content.data(), size);
    content.resize(4 + gemelo::kDigestSize, digest);
    content.resize(4 + gemelo::kDigestSize + 8, 0x30);
    return content;
}

Bytes seal(Bytes bytes) {
    const size_t size = bytes.size();
    bytes.resize(size + gemelo::kCrcSize);
    gemelo::seal_frame(bytes.data(), size);
    return bytes;
}

uint32_t ChunkSpec::dt_to(size_t k) const {
    return replacing && k + replacing->tail >= rows.size() ? replacing->tail_dt_us : dt_us;
}

Bytes build(const ChunkSpec& chunk) {
    Bytes bytes =
        header(gemelo::FrameType::Traj, chunk.rows.empty() ? 2 : chunk.rows[0].position.size(), chunk.boot_id);
    add_u32(bytes, chunk.stream);
    add_u32(bytes, chunk.seq);
    add_u64(bytes, chunk.expires_us);
    add_u32(bytes, chunk.dt_us);
    add_u16(bytes, static_cast<uint16_t>(chunk.rows.size()));
    add_u16(bytes, static_cast<uint16_t>((chunk.first ? 1 : 0) | (chunk.last ? 2 : 0) | (chunk.replacing ? 4 : 0)));
    if (chunk.replacing) {
        add_u64(bytes, chunk.replacing->from_us);
        add_u32(bytes, chunk.replacing->tail_dt_us);
        add_u16(bytes, chunk.replacing->tail);
        add_u16(bytes, 0);
    }
    for (const Row& row : chunk.rows) {
        for (int32_t value : row.position) add_u32(bytes, static_cast<uint32_t>(value));
        for (int32_t value : row.velocity) add_u32(bytes, static_cast<uint32_t>(value));
    }
    return seal(bytes);
}

Bytes build_command(gemelo::Command command, uint32_t id, const std::vector<int32_t>& position, uint64_t expires_us,
                    uint32_t boot_id, uint8_t index, uint16_t argument) {
    Bytes bytes = header(gemelo::FrameType::Cmd, position.size(), boot_id);
    add_u32(bytes, id);
    add_u64(bytes, expires_us);
    add_u8(bytes, static_cast<uint8_t>(command));
    add_u8(bytes, index);
    add_u16(bytes, argument);
    for (int32_t value : position) add_u32(bytes, static_cast<uint32_t>(value));
    return seal(bytes);
}

Bytes build_heartbeat(uint32_t session, uint32_t counter, uint32_t boot_id) {
    Bytes bytes = header(gemelo::FrameType::Heartbeat, 0, boot_id);
    add_u32(bytes, session);
    add_u32(bytes, counter);
    return seal(bytes);
}

Bytes build_sync(uint64_t t0) {
    Bytes bytes = header(gemelo::FrameType::Sync, 0, 0);
    add_u64(bytes, t0);
    return seal(bytes);
}

}  // namespace rig
