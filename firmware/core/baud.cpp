#include "baud.h"

namespace gemelo {
namespace {

// More than any frame's header and than a text line of six joints: chosen so that at the right rate something is
// understood.
constexpr size_t kStrange = 128;
constexpr uint64_t kTrialUs = 300000;  // chosen: three heartbeats of a host
// A sender that was understood is believed for so long (chosen): what disturbs the line must not lose it.
constexpr uint64_t kBeliefUs = 2000000;
constexpr uint32_t kUsual[] = {kDefaultBaud, 115200, 57600, 9600};  // standard: what terminals and boards are set to

}  // namespace

uint32_t read_baud(const char* text) {
    uint32_t rate = 0;
    for (; *text != 0; ++text) {
        if (*text < '0' || *text > '9' || rate > kMostBaud) return 0;
        rate = rate * 10 + static_cast<uint32_t>(*text - '0');
    }
    return rate >= kLeastBaud && rate <= kMostBaud ? rate : 0;
}

BaudSearch::BaudSearch(uint32_t set_rate) {
    if (set_rate != 0) rates_[count_++] = set_rate;
    for (const uint32_t usual : kUsual)
        if (usual != set_rate) rates_[count_++] = usual;
}

bool BaudSearch::hear(size_t bytes, uint32_t understood, uint64_t now_us) {
    if (understood != understood_) {
        understood_ = understood;
        strange_ = 0;
        is_believed_ = true;
        settled_us_ = now_us;
        return false;
    }
    strange_ += bytes;
    const uint64_t patience_us = is_believed_ ? kBeliefUs : kTrialUs;
    if (strange_ < kStrange || now_us < settled_us_ + patience_us) return false;
    at_ = static_cast<uint8_t>((at_ + 1) % count_);
    strange_ = 0;
    is_believed_ = false;
    settled_us_ = now_us;
    return true;
}

}  // namespace gemelo
