// A gateway of few words over a bad link: frames are lost, late, doubled and out of order; it sends from next_seq on.
#pragma once

#include <deque>
#include <set>

#include "live_stream.h"
#include "random_path.h"
#include "stand.h"

namespace property {

class Gateway {
  public:
    // `repeats` says every frame twice and listens to the first answer only.
    Gateway(Stand& stand, uint32_t boot_id, uint64_t seed, bool repeats);

    // In each slot, at a tick between two others.
    void work();
    bool has_stream() const { return path_.has_value() || live_.has_value(); }
    // The device has taken all of the stream.
    bool is_done() const;
    void open_stream() { open_stream(dice_.chance(0.4)); }
    // `is_live`: one that is steered, with REPLACE.
    void open_stream(bool is_live);
    void end_stream();
    void forget_stream();
    const std::optional<LiveStream>& live() const { return live_; }
    // Its answer; now and then an old command is said again, and must be answered as before.
    gemelo::Code command(gemelo::Command command, uint16_t argument = 0, const std::vector<int32_t>& position = {});
    // Every frame so far.
    const std::vector<rig::Bytes>& said() const { return said_; }
    // Q24.8 steps where the last knot of the stream lies.
    const std::vector<int32_t>& target() const;

    bool is_feeding = true, is_beating = true;

  private:
    struct Letter {
        uint64_t due_us;
        rig::Bytes frame;
    };
    struct Judged {
        rig::Bytes frame;
        gemelo::Code code;
    };
    void send_due();
    void send_live();
    uint64_t played_us() const;
    bool may_say(const ChunkAnswer& answer) const;
    void take(uint32_t seq);
    void post(const rig::Bytes& frame);
    void deliver_due();
    void deliver(const rig::Bytes& frame);
    void hear(const ChunkAnswer& answer);

    Stand& stand_;
    uint32_t boot_id_;
    Dice dice_;
    bool repeats_;
    std::optional<RandomPath> path_;
    std::optional<LiveStream> live_;
    bool is_ending_ = false;    // of the latter
    std::set<uint32_t> wrong_;  // seq of what must not be taken
    uint64_t next_live_us_ = 0;
    std::vector<rig::ChunkSpec> chunks_;
    std::vector<uint64_t> begins_us_;  // stream time at which each chunk begins
    std::deque<Letter> link_;
    std::deque<Judged> judged_;
    std::vector<rig::Bytes> said_;
    uint64_t lead_us_ = 0;
    uint64_t full_until_us_ = 0;
    uint64_t heard_us_ = 0;  // when the device last took something
    uint64_t next_beat_us_ = 0;
    size_t next_ = 0, taken_ = 0;  // seq
    uint32_t stream_ = 0, commands_ = 0;
};

}  // namespace property
