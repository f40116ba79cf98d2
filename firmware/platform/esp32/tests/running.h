// A board that runs: the layer's own device in its task, with a serial line and a broker to speak with it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "board.h"
#include "device.h"
#include "fake_idf.h"
#include "frames.h"
#include "store.h"

using namespace gemelo;
using fake::chip;

inline const std::string kConfig =
    R"({"name":"rm1","joints":[{"name":"q1","lower_q8":-2560000,"upper_q8":2560000,"max_velocity_q8":1280000,)"
    R"("max_acceleration_q8":12800000,"dir_setup_us":5,"step_pin":25,"dir_pin":27}],"armed_at_boot":true,)"
    R"("enable_pin":13,"enable_inverted":true,"inputs":[{"name":"estop","pin":21,"role":"estop","pull":"up"}],)"
    R"("outputs":[{"name":"lamp","pin":2}]})";

inline bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// A device after a reset, in its task, and a serial line and a broker to speak with it.
class Running {
  public:
    explicit Running(esp_reset_reason_t reason) {
        chip.reset_reason = reason;
        fake::reset();
        board = Board{};
        load_credentials(&credentials_);
        line_.begin(nobody_, rig::kBoot, nullptr, nullptr);
        device_->begin(credentials_, rig::kBoot);
        device_->set_network(reinterpret_cast<TaskHandle_t>(&credentials_));
        task_ = std::make_unique<fake::Task>([this] { device_->run(); });
        pass_ms(5);
    }
    void pass_ms(uint32_t ms) { task_->grant(ms); }
    bool has_restarted() const { return task_->has_restarted(); }

    void tell_over_wire(FrameType type, const std::string& json) {
        uint8_t packet[8400];
        const size_t size =
            line_.wrap_json(type, reinterpret_cast<const uint8_t*>(json.data()), json.size(), packet, sizeof packet);
        for (size_t at = 0; at < size; at += 200)
            board.from_wire.push(static_cast<uint8_t>(Inbound::Bytes), 0, chip.now_us, packet + at,
                                 size - at < 200 ? size - at : 200);
        pass_ms(5);
    }
    void tell_over_mqtt(const rig::Bytes& frame, Inbound kind = Inbound::Frame) {
        board.from_mqtt.push(static_cast<uint8_t>(kind), 0, chip.now_us, frame.data(), frame.size());
        pass_ms(3);
    }
    void command(Command command, const std::vector<int32_t>& position = {}) {
        tell_over_mqtt(rig::build_command(command, ++commands_, position));
    }
    // A stream of its own from rest to rest.
    void move(int32_t from, int32_t to, int slices = 20) {
        rig::ChunkSpec chunk;
        chunk.stream = ++streams_;
        chunk.first = chunk.last = true;
        chunk.rows.push_back({{from * 256}, {0}});
        for (int i = 1; i <= slices; ++i) {
            const double u = static_cast<double>(i) / slices;
            const double place = from + (to - from) * u * u * (3 - 2 * u);
            const double speed = (to - from) * 6 * u * (1 - u) / (slices * 0.02);
            chunk.rows.push_back({{static_cast<int32_t>(place * 256)}, {static_cast<int32_t>(speed * 256)}});
        }
        chunk.rows.back() = {{to * 256}, {0}};
        tell_over_mqtt(rig::build_heartbeat(1, ++beats_));
        tell_over_mqtt(rig::build(chunk));
    }
    // What has been said since the last call: all bytes, as they went to the wire.
    std::string said_on_wire() { return drain(board.to_wire, 255); }
    std::string said(Output output) { return drain(board.to_mqtt, static_cast<uint8_t>(output)); }

  private:
    template <uint32_t kCapacity>
    static std::string drain(Ring<kCapacity>& ring, uint8_t kind) {
        std::string all;
        for (Record record; ring.front(&record); ring.pop())
            if (kind == 255 || record.kind == kind)
                all.append(reinterpret_cast<const char*>(record.bytes), record.size);
        return all;
    }

    Credentials credentials_;
    Machine nobody_;
    SerialPort line_;
    std::unique_ptr<Device> device_ = std::make_unique<Device>();
    std::unique_ptr<fake::Task> task_;
    uint32_t commands_ = 0, streams_ = 0, beats_ = 0;
};
