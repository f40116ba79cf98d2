#include "path.h"

namespace gemelo {
namespace {

constexpr uint32_t kUnknownCeiling = UINT32_MAX;

}  // namespace

void Path::begin(const DeviceConfig& config) {
    joints_ = static_cast<uint8_t>(config.joints);
    queue_.begin(static_cast<uint16_t>(config.queue_capacity));
    ceiling_.begin(config);
    scale_.begin(config);
    flush();
}

void Path::start(const Knot& knot, uint32_t scale_q30) {
    flush();
    from_ = knot;
    from_.ceiling_q26 = kUnknownCeiling;
    from_us_ = 0;
    is_active_ = true;
    scale_.set(scale_q30);
}

Knot& Path::append() {
    Knot& fresh = queue_.push();
    fresh.ceiling_q26 = kUnknownCeiling;
    return fresh;
}

void Path::accept(Ending ending, uint64_t tail_us) {
    ending_ = ending;
    tail_us_ = tail_us < kLongestTailUs ? tail_us : kLongestTailUs;
    queued_us_ = 0;
    for (uint16_t i = 0; i < queue_.size(); ++i) queued_us_ += queue_[i].dt_us;
    refresh_ceilings();
    if (segment_.dt_us == 0) load();
}

void Path::flush() {
    queue_.clear();
    segment_.dt_us = 0;
    from_us_ += elapsed_ >> kTimeBits;
    elapsed_ = 0;
    queued_us_ = 0;
    is_active_ = false;
    ending_ = Ending::Open;
    tail_us_ = 0;
    scale_.set(0);
}

// Takes the next segment into play, if there is one.
void Path::load() {
    elapsed_ = 0;
    if (queue_.is_empty()) {
        segment_.dt_us = 0;
    } else {
        segment_.load(from_, queue_[0], joints_);
    }
}

// The knot that the path has ended on is passed, though the stream's end is said two slots later.
int32_t Path::find(uint64_t at_us) const {
    const bool has_ended = ending_ == Ending::Last && queue_.is_empty();
    if (at_us == from_us_ && elapsed_ == 0 && !has_ended) return kHere;
    if (at_us <= play_us()) return kPassed;
    uint64_t time_us = from_us_;
    for (uint16_t i = 0; i < queue_.size(); ++i) {
        time_us += queue_[i].dt_us;
        if (time_us == at_us) return i;
    }
    return kNowhere;
}

uint16_t Path::space_behind(int32_t place) const {
    return static_cast<uint16_t>(queue_.space() + queue_.size() - (place + 1));
}

uint32_t Path::played_q26() const {
    const uint64_t s_q30 = scale_.value();
    return static_cast<uint32_t>((s_q30 * s_q30) >> 34);
}

// Backwards from the place; once a knot's ceiling does not fall, what is before it stands as it is.
uint32_t Path::ceiling_with(int32_t place, uint32_t ceiling_q26) const {
    uint32_t next_q26 = ceiling_q26;
    for (int32_t i = place; i >= 0; --i) {
        if (ceiling_q26 >= knot(i).ceiling_q26) return kFullCeiling;
        next_q26 = ceiling_q26;
        ceiling_q26 = ceiling_.before(knot(i - 1), knot(i), ceiling_q26);
    }
    return ceiling_q26 < next_q26 ? ceiling_q26 : next_q26;
}

// Forgets what is behind the place; accept() loads what comes there instead.
void Path::cut(int32_t place) {
    queue_.truncate(static_cast<uint16_t>(place + 1));
    if (place == kHere) segment_.dt_us = 0;
}

bool Path::is_braking() const {
    const uint64_t left_us = remaining_us();
    return left_us != 0 && left_us <= tail_us_ && scale_.value() > kFullScale / 2;
}

// Backwards from the newest knot; once a knot's ceiling comes out as it was, the older ones stand as they are.
void Path::refresh_ceilings() {
    if (queue_.is_empty()) return;
    uint16_t i = static_cast<uint16_t>(queue_.size() - 1);
    queue_[i].ceiling_q26 = ending_ == Ending::Open ? 0 : kFullCeiling;
    while (true) {
        Knot& from = i == 0 ? from_ : queue_[static_cast<uint16_t>(i - 1)];
        const uint32_t ceiling = ceiling_.before(from, queue_[i], queue_[i].ceiling_q26);
        if (i == 0 || from.ceiling_q26 == ceiling) {
            from.ceiling_q26 = ceiling;
            return;
        }
        from.ceiling_q26 = ceiling;
        --i;
    }
}

// What of the i-th segment from here is left, in Q20.
int64_t Path::left_share(uint16_t i, uint64_t left) const {
    if (i == 0) return segment_.share(left, 20);
    return static_cast<int64_t>((left << (20 - kTimeBits)) / queue_[i].dt_us);
}

int64_t Path::per_dt_q32(uint16_t i) const {
    return i == 0 ? static_cast<int64_t>(segment_.per_dt_q48 >> 16) : UINT32_MAX / queue_[i].dt_us;
}

// Where the next slot will end at the present scale, on the straight line between the ceilings of the knots there.
Allowance Path::allowance() const {
    uint64_t at = elapsed_ + ((static_cast<uint64_t>(scale_.value()) * kSlotUs) >> (30 - kTimeBits));
    uint16_t i = 0;
    uint32_t high = from_.ceiling_q26;
    uint64_t whole = static_cast<uint64_t>(segment_.dt_us) << kTimeBits;
    while (at >= whole && i + 1 < queue_.size()) {
        at -= whole;
        high = queue_[i].ceiling_q26;
        whole = static_cast<uint64_t>(queue_[++i].dt_us) << kTimeBits;
    }
    const uint32_t low = queue_[i].ceiling_q26;
    if (high >= kFullCeiling && low >= kFullCeiling) return Allowance{kFullCeiling, 0};
    const int64_t fall = static_cast<int64_t>(high) - low;
    const int64_t left_q20 = at < whole ? left_share(i, whole - at) : 0;
    const int64_t ceiling = low + ((fall * left_q20) >> 20);
    const int64_t slope_q30 = fall > 0 ? fall * 16 * (kSlotUs / 2) * per_dt_q32(i) >> 32 : 0;
    return Allowance{static_cast<uint32_t>(ceiling), static_cast<uint32_t>(slope_q30)};
}

void Path::move(uint64_t step) {
    while (segment_.dt_us != 0 && step >= segment_left()) {
        step -= segment_left();
        from_ = queue_[0];
        from_us_ += segment_.dt_us;
        queued_us_ -= segment_.dt_us;
        queue_.pop();
        load();
    }
    if (segment_.dt_us != 0) elapsed_ += step;
}

void Path::advance(uint32_t bound_q30, Point* point) {
    if (is_active_ && segment_.dt_us != 0) {
        scale_.advance(bound_q30, segment_, allowance());
        move((static_cast<uint64_t>(scale_.value()) * kSlotUs) >> (30 - kTimeBits));
        point->scale_q30 = scale_.value();
    } else {
        scale_.set(0);
        point->scale_q30 = 0;
    }
    const bool is_at_last = is_active_ && segment_.dt_us == 0;
    if (is_at_last) scale_.set(0);
    point->is_end = is_at_last && ending_ == Ending::Last;
    point->is_starved = is_at_last && ending_ == Ending::Open;
    point->play_us = play_us();
    if (!is_active_) return;
    const uint32_t u_q24 = segment_.dt_us == 0 ? 0 : segment_.share(elapsed_, kUnitBits);
    for (uint8_t j = 0; j < joints_; ++j) {
        point->position_q20[j] = segment_.dt_us == 0 ? as_q20(from_.position[j]) : segment_.cubic[j].at(u_q24);
    }
}

uint64_t Path::remaining_us() const { return queued_us_ - (elapsed_ >> kTimeBits); }

}  // namespace gemelo
