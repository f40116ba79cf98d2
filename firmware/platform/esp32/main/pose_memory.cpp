#include "pose_memory.h"

#include <string.h>

#include "bytes.h"
#include "crc32.h"

namespace gemelo {

bool Pose::operator==(const Pose& other) const {
    return memcmp(steps, other.steps, sizeof steps) == 0 && config_crc32 == other.config_crc32 &&
           is_referenced == other.is_referenced && is_moving == other.is_moving;
}

void PoseMemory::keep(const Pose& pose) {
    crc_ = ~crc_;  // a reset between here and the end leaves nothing valid
    pose_ = pose;
    crc_ = seal();
}

// Over the fields, not the struct: its padding is anything.
uint32_t PoseMemory::seal() const {
    uint8_t bytes[4 * kMaxJoints + 6];
    for (uint8_t j = 0; j < kMaxJoints; ++j) store_i32(bytes + 4 * j, pose_.steps[j]);
    store_u32(bytes + 4 * kMaxJoints, pose_.config_crc32);
    bytes[4 * kMaxJoints + 4] = pose_.is_referenced ? 1 : 0;
    bytes[4 * kMaxJoints + 5] = pose_.is_moving ? 1 : 0;
    return crc32(bytes, sizeof bytes);
}

Awakening wake(const PoseMemory& memory, bool is_warm, uint32_t config_crc32) {
    Awakening awakening{};
    const Pose& pose = memory.pose();
    if (!is_warm || !memory.is_valid() || pose.config_crc32 != config_crc32) return awakening;
    awakening.was_moving = pose.is_moving;
    if (pose.is_moving) return awakening;
    memcpy(awakening.steps, pose.steps, sizeof awakening.steps);
    awakening.is_referenced = pose.is_referenced;
    return awakening;
}

}  // namespace gemelo
