#include "provisioning.h"

#include "board.h"
#include "esp_system.h"
#include "json.h"
#include "store.h"

namespace gemelo {
namespace {

constexpr uint64_t kUntilSaidUs = 300000;  // for the answer to leave the wire

}  // namespace

void Provisioning::receive(const uint8_t* text, size_t size, const Machine& machine, Credentials* proposed,
                           uint64_t now_us) {
    if (!machine.keeps_still()) return answer(false, "the arm is moving: stop it first");
    if (proposed == nullptr) return answer(false, "a configuration is being written: send it again");
    Refusal refusal;
    *proposed = *credentials_;
    if (!parse_provision(reinterpret_cast<const char*>(text), size, proposed, &refusal))
        return answer(false, refusal.reason);
    const bool is_kept = proposed->is_factory_reset ? forget_all() : save_credentials(*proposed);
    if (is_kept) restart_us_ = now_us + kUntilSaidUs;
    answer(is_kept, is_kept ? "" : "the flash memory cannot be written");
}

void Provisioning::restart_if_due(const Machine& machine, uint64_t now_us) {
    if (!machine.keeps_still()) return;
    if (is_reset_asked_ && forget_all()) restart_us_ = now_us;
    is_reset_asked_ = false;
    if (restart_us_ != 0 && now_us >= restart_us_) esp_restart();
}

void Provisioning::answer(bool is_accepted, const char* reason) const {
    JsonWriter json;
    json.field("accepted", is_accepted);
    json.field("reason", reason);
    const size_t size = json.close();
    uint8_t framed[SerialPort::kLargestReport];
    const size_t length = serial_->wrap_json(FrameType::ProvisionAck, json.bytes(), size, framed, sizeof framed);
    if (length != 0) board.to_wire.push(static_cast<uint8_t>(FrameType::ProvisionAck), 0, 0, framed, length);
}

}  // namespace gemelo
