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

// What is behind the last knot of a path: more must come, more may come, nothing comes.
enum class Ending : uint8_t { Open, Rest, Last };

class Path {
  public:
    void begin(const DeviceConfig& config);

    // A new stream that starts at `knot`, at rest, to be played at this time scale.
    void start(const Knot& knot, uint32_t scale_q30);
    // The next knot, to be filled.
    Knot& append();
    // After the last append of a chunk; the last `tail_us` of the path only lead to rest.
    void accept(Ending ending, uint64_t tail_us);

    // Where a path may be replaced: behind the i-th queued knot, or behind the one that was passed last, as it stands.
    // Chosen: below every index.
    static constexpr int32_t kHere = -1, kPassed = -2, kNowhere = -3;
    int32_t find(uint64_t at_us) const;
    const Knot& knot(int32_t place) const { return place < 0 ? from_ : queue_[static_cast<uint16_t>(place)]; }
    uint16_t space_behind(int32_t place) const;
    uint32_t ceiling_before(const Knot& from, const Knot& to, uint32_t next_q26) const {
        return ceiling_.before(from, to, next_q26);
    }
    // The lowest ceiling that would be left where it is played now, were this the ceiling at the place.
    uint32_t ceiling_with(int32_t place, uint32_t ceiling_q26) const;
    void cut(int32_t place);

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
    Ending ending() const { return ending_; }
    uint64_t play_us() const { return from_us_ + (elapsed_ >> kTimeBits); }
    uint32_t played_q26() const;  // the square of the time scale
    // It brakes to rest by itself, and soon.
    bool is_braking() const;

  private:
    void load();
    void refresh_ceilings();
    Allowance allowance() const;
    int64_t left_share(uint16_t i, uint64_t left) const;
    int64_t per_dt_q32(uint16_t i) const;
    void move(uint64_t step);
    uint64_t segment_left() const { return (static_cast<uint64_t>(segment_.dt_us) << kTimeBits) - elapsed_; }

    static constexpr uint8_t kTimeBits = 15;             // path time is counted in 2^-15 us; chosen
    static constexpr uint64_t kLongestTailUs = 3000000;  // chosen: twice what the slowest arm of this project needs

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
    Ending ending_ = Ending::Open;
    uint64_t tail_us_ = 0;  // of path time at the end
};

}  // namespace gemelo
