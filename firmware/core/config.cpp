#include "config.h"

#include <string.h>

namespace gemelo {
namespace {

bool is_name(const char* name) {
    const void* end = memchr(name, 0, kNameSize);
    if (end == nullptr || end == name) return false;
    for (; *name != 0; ++name) {
        const char c = *name;
        const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        if (!plain && c != '_' && c != '-') return false;
    }
    return true;
}

const char* find_joint_fault(const JointConfig& joint) {
    if (!is_name(joint.name)) return "its name is not 1 to 31 letters, digits, '_' or '-'";
    if (joint.lower_q8 >= joint.upper_q8) return "its lower limit is not below its upper limit";
    if (joint.max_velocity_q8 <= 0) return "its velocity limit is not positive";
    if (joint.max_acceleration_q8 <= 0) return "its acceleration limit is not positive";
    if (joint.dir_setup_us > 200) return "its DIR set-up time is longer than 200 us";
    return nullptr;
}

}  // namespace

ConfigFault find_fault(const DeviceConfig& config) {
    if (!is_name(config.name)) return {"its name is not 1 to 31 letters, digits, '_' or '-'"};
    if (config.tick_hz < 10 * kSlotHz || config.tick_hz > kMaxTickHz || config.tick_hz % kSlotHz != 0)
        return {"tick_hz is not a multiple of 1000 between 10000 and 100000"};
    if (config.queue_capacity < 2 || config.queue_capacity > kMaxKnots) return {"queue_capacity is not 2 to 128 knots"};
    if (config.state_hz < 1 || config.state_hz > kSlotHz || kSlotHz % config.state_hz != 0)
        return {"state_hz does not divide 1000"};
    if (config.hold_timeout_ms < 1 || config.hold_timeout_ms > 60000) return {"hold_timeout_ms is not 1 to 60000"};
    if (config.joints < 1 || config.joints > kMaxJoints) return {"there are not 1 to 8 joints"};
    for (uint8_t j = 0; j < config.joints; ++j) {
        const char* sentence = find_joint_fault(config.joint[j]);
        if (sentence != nullptr) return {sentence, config.joint[j].name};
    }
    return {};
}

int32_t velocity_limit_q8(const DeviceConfig& config, uint8_t joint) {
    const int32_t fastest_q8 = static_cast<int32_t>(config.tick_hz / 2) * 256;
    const int32_t limit_q8 = config.joint[joint].max_velocity_q8;
    return limit_q8 < fastest_q8 ? limit_q8 : fastest_q8;
}

}  // namespace gemelo
