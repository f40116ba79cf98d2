// A device on the bench: builds frames, lets time pass, reads what the device says.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frames.h"
#include "virtual_device.h"

namespace rig {

// Two joints that do 4000 steps/s after a second, within +-100,000 steps.
gemelo::DeviceConfig two_joints();

struct Ack {
    uint32_t stream, seq, next_seq;
    gemelo::Code code;
    uint8_t joint;
    uint16_t knot;
    int32_t value, limit;
    uint16_t credits, buffered_ms;
};

struct State {
    uint64_t t_us;
    gemelo::Mode mode;
    uint16_t time_scale;
    uint64_t play_us;
    uint32_t underruns, refused, bad_frames;
    std::vector<int32_t> steps, velocity_q8;
};

class Rig {
  public:
    explicit Rig(const gemelo::DeviceConfig& config = two_joints(), bool referenced = true, uint64_t now_us = 0,
                 uint32_t boot_id = kBoot);

    Ack send(const ChunkSpec& chunk, bool retained = false);
    Ack send(const Bytes& frame, bool retained = false);
    gemelo::Code command(gemelo::Command command, const std::vector<int32_t>& position = {});
    gemelo::Code send_command(const Bytes& frame, bool retained = false);
    void beat();

    // Lets time pass; with a heartbeat every 200 ms unless `silent`.
    void run_ms(uint32_t ms, bool silent = false);
    void run_until_idle(uint32_t at_most_ms = 60000);

    // Reads all that was said until now.
    void listen();
    int count_events(const std::string& name) const;
    // The last event of this name as JSON, or an empty text.
    std::string event(const std::string& name) const;
    const State& state();

    gemelo::Mode mode() { return device.machine().mode(); }
    int32_t steps(uint8_t joint) { return device.machine().stepper().executed(joint); }
    double path(uint8_t joint) { return device.machine().present().position_q20[joint] / 1048576.0; }

    gemelo::VirtualDevice device;
    std::optional<Ack> ack;
    std::vector<std::string> events;

  private:
    void read(const gemelo::OutFrame& frame);

    uint32_t joints_;
    uint32_t boot_id_;
    uint32_t beats_ = 0;
    uint32_t next_command_ = 1;
    uint64_t next_beat_us_ = 0;
    std::optional<gemelo::Code> command_code_;
    State state_{};
};

}  // namespace rig
