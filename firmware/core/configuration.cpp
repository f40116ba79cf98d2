// Taking a configuration.
#include "config_text.h"
#include "crc32.h"
#include "machine.h"

namespace gemelo {

void Machine::receive_config(const Arrival& arrival, uint64_t now_us) {
    now_us_ = now_us;
    const uint32_t crc = gemelo::crc32(arrival.bytes, arrival.size);
    const auto refuse = [this, crc](const char* part, const char* reason) {
        reporter_.acknowledge_config(crc, false, part, reason);
    };
    // A crc32 of 0 stands for no text.
    if (crc != 0 && crc == config_->crc32) return reporter_.acknowledge_config(crc, true, "", "");
    // Before it is read: reading takes longer than a slot may.
    if (!takes_config()) return refuse("", "the device is armed: disarm it first");
    DeviceConfig config;
    Refusal refusal;
    const char* text = reinterpret_cast<const char*>(arrival.bytes);
    if (!parse_config(text, arrival.size, &config, &refusal)) return refuse(refusal.part, refusal.reason);
    const Sink& sink = reporter_.sink();
    const ConfigFault fault = sink.check == nullptr ? ConfigFault{} : sink.check(sink.context, config);
    if (fault.sentence != nullptr) return refuse(fault.part, fault.sentence);
    *config_ = config;
    if (sink.keep != nullptr) sink.keep(sink.context, arrival.bytes, arrival.size);
    reporter_.acknowledge_config(crc, true, "", "");
    restart();
}

}  // namespace gemelo
