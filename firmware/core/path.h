// The path that is played: knots in, one point for every slot out.
#pragma once

#include <stdint.h>

#include "ceiling.h"
#include "knot_queue.h"
#include "segment.h"
#include "time_scale.h"

namespace gemelo {

// Where the path is at the end of a slot.
struct Point {
    int64_t position_q20[kMaxJoints];
    uint64_t play_us;    // stream time
    uint32_t stream;     // that `play_us` belongs to
    uint32_t scale_q30;  // the time scale of this slot
    bool is_start;       // the stream's first slot
    bool is_end;         // the stream ended here
    bool is_starved;     // the last knot that is known, and the stream goes on
};

class Path {
  public:
    void begin(const DeviceConfig& config);

    // A new stream that starts at `knot`, at rest, to be played at this time scale.
    void start(const Knot& knot, uint32_t scale_q30);
    void append(const Knot& knot);
    // After the last append of a chunk; `ends` says that the stream's last knot is in.
    void accept(bool ends);
    // The arm has come to a stand in the midst of it: goes on from rest.
    void pause() { scale_.set(0); }
    // Forgets what has not been played; the path ends where it stands.
    void flush();

    // Plays one slot, at a time scale of at most `bound` in the end. Fills all but the positions of a flushed path.
    void advance(uint32_t bound_q30, Point* point);

    // The last knot that was accepted: the next chunk continues from it.
    const Knot& newest() const { return queue_.is_empty() ? from_ : queue_.newest(); }
    uint16_t space() const { return queue_.space(); }
    uint64_t remaining_us() const;
    bool is_active() const { return is_active_; }
    bool ends() const { return ends_; }

  private:
    void load();
    void refresh_ceilings();
    Allowance allowance() const;
    int64_t left_share(uint16_t i, uint64_t left) const;
    int64_t per_dt_q32(uint16_t i) const;
    void move(uint64_t step);
    uint64_t segment_left() const { return (static_cast<uint64_t>(segment_.dt_us) << kTimeBits) - elapsed_; }

    static constexpr uint8_t kTimeBits = 15;  // path time is counted in 2^-15 us; chosen

    uint8_t joints_ = 0;
    KnotQueue queue_;
    Ceiling ceiling_;
    TimeScale scale_;
    Knot from_;               // the knot that was passed last
    Segment segment_;         // from there to the queue's oldest
    uint64_t elapsed_ = 0;    // since `from_`, in 2^-15 us
    uint64_t from_us_ = 0;    // stream time of `from_`
    uint64_t queued_us_ = 0;  // path time of all queued knots
    bool is_active_ = false;
    bool ends_ = false;
};

}  // namespace gemelo
