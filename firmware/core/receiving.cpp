// Received frames: chunks of knots, heartbeats, clock synchronisation and updates.
#include "bytes.h"
#include "machine.h"

namespace gemelo {
namespace {

constexpr uint32_t kMostMissed = 1024;  // heartbeats in a row; chosen: a minute and a half of them
// Chosen: after a minute any newer counter counts, as that many may be lost by then.
constexpr uint64_t kSilenceUs = 60000000;
// Chosen: forty heartbeats, so that a gateway that starts anew costs no subscription.
constexpr uint64_t kSubscribeAgainUs = 4000000;

// For no joint.
Verdict refuse(Code code, uint32_t value = 0, uint32_t limit = 0) {
    return Verdict{code, kNoJoint, 0, static_cast<int32_t>(value), static_cast<int32_t>(limit)};
}

}  // namespace

void Machine::receive(const Arrival& arrival, uint64_t now_us) {
    const Frame frame = open_frame(arrival.bytes, arrival.size);
    if (!frame.is_valid()) return count_bad_frame();
    receive(frame, arrival, now_us);
}

void Machine::receive(const Frame& frame, const Arrival& arrival, uint64_t now_us) {
    now_us_ = now_us;
    switch (frame.type()) {
        case FrameType::Traj:
            return receive_chunk(frame, arrival);
        case FrameType::Cmd:
            return receive_command(frame, arrival);
        case FrameType::Heartbeat:
            return receive_heartbeat(frame, arrival);
        case FrameType::Sync:
            return receive_sync(frame, arrival);
        case FrameType::Update:
            return receive_update(frame, arrival);
        default:
            ++bad_frames_;
    }
}

void Machine::receive_chunk(const Frame& frame, const Arrival& arrival) {
    if (frame.size < kChunkHeaderSize) {
        ++bad_frames_;
        return;
    }
    const Chunk chunk(frame);
    const Verdict verdict = judge(chunk, arrival);
    if (verdict.is_ok()) {
        take_chunk(chunk);
    } else if (verdict.code != Code::Duplicate) {
        ++refused_;
    }
    acknowledge(chunk, verdict);
}

Verdict Machine::judge(const Chunk& chunk, const Arrival& arrival) const {
    if (arrival.is_retained) return refuse(Code::Retained);
    if (chunk.boot_id() != identity_.boot_id) return refuse(Code::WrongBoot);
    if (chunk.joints() != rules_.joints) return refuse(Code::BadJoints, chunk.joints(), rules_.joints);
    if (!chunk.has_right_size()) return refuse(Code::BadCount, chunk.knots(), kMaxKnots);
    if (is_duplicate(chunk)) return refuse(Code::Duplicate);
    if (now_us_ > chunk.expires_us()) return refuse(Code::Expired);
    const Verdict place = judge_place(chunk);
    if (!place.is_ok()) return place;
    if (chunk.is_replacement() && !chunk.is_first()) return judge_replacement(chunk);
    if (chunk.knots() > path_.space()) return refuse(Code::NoSpace, chunk.knots(), path_.space());
    Knot before = path_.newest();
    if (chunk.is_first()) {
        for (uint8_t j = 0; j < rules_.joints; ++j) before.position[j] = as_q8(present().position_q20[j]);
    }
    return check_knots(chunk, rules_, before);
}

bool Machine::is_duplicate(const Chunk& chunk) const {
    return chunk.stream() != 0 && chunk.stream() == streams_.stream() && chunk.seq() < streams_.next_seq();
}

// Checks that this chunk is the expected one.
Verdict Machine::judge_place(const Chunk& chunk) const {
    const Verdict not_ready = refuse(Code::NotReady, static_cast<uint32_t>(mode_));
    const Verdict wrong_stream = refuse(Code::WrongStream);
    if (mode_ != Mode::Idle && mode_ != Mode::Run && mode_ != Mode::Hold) return not_ready;
    if (is_stopping_) return not_ready;
    if (chunk.stream() == 0 || streams_.is_past(chunk.stream())) return wrong_stream;
    const bool is_playing = path_.is_active() && chunk.stream() == streams_.stream();
    if (is_playing) {
        if (chunk.is_first()) return wrong_stream;
        if (chunk.is_replacement()) return Verdict{};
        if (path_.ending() != Ending::Open) return wrong_stream;
        return chunk.seq() == streams_.next_seq() ? Verdict{} : refuse(Code::Gap, chunk.seq(), streams_.next_seq());
    }
    if (chunk.stream() == streams_.stream()) return wrong_stream;
    if (chunk.is_first() && chunk.seq() == 0) {
        if (mode_ != Mode::Idle) return not_ready;
        return takes_motion() ? Verdict{} : refuse(Code::NotArmed);
    }
    return mode_ == Mode::Idle && chunk.seq() != 0 && !chunk.is_first() ? refuse(Code::Gap, chunk.seq()) : wrong_stream;
}

// Checks that it goes on from a knot of the path that has not been passed, and that the arm can stop on it.
Verdict Machine::judge_replacement(const Chunk& chunk) const {
    const int32_t place = path_.find(chunk.from_us());
    if (place == Path::kPassed)
        return refuse(Code::Late, static_cast<uint32_t>(chunk.from_us()), static_cast<uint32_t>(path_.play_us()));
    if (place == Path::kNowhere || !chunk.begins_with(path_.knot(place)))
        return refuse(Code::OtherKnot, chunk.seq(), streams_.next_seq());
    const uint16_t knots = static_cast<uint16_t>(chunk.knots() - 1), space = path_.space_behind(place);
    if (knots > space) return refuse(Code::NoSpace, knots, space);
    const Verdict verdict = check_knots(chunk, rules_, path_.knot(place));
    if (!verdict.is_ok()) return verdict;
    const uint32_t ceiling_q26 = path_.ceiling_with(place, ceiling_of(chunk));
    return ceiling_q26 < path_.played_q26() ? refuse(Code::NoStop, ceiling_q26, path_.played_q26()) : Verdict{};
}

// At knot 0.
uint32_t Machine::ceiling_of(const Chunk& chunk) const {
    Knot pair[2];
    uint16_t k = static_cast<uint16_t>(chunk.knots() - 1);
    chunk.read_knot(k, &pair[k % 2]);
    uint32_t ceiling_q26 = chunk.ends_at_rest() ? kFullCeiling : 0;
    for (; k > 0; --k) {
        Knot& from = pair[(k - 1) % 2];
        chunk.read_knot(static_cast<uint16_t>(k - 1), &from);
        ceiling_q26 = path_.ceiling_before(from, pair[k % 2], ceiling_q26);
    }
    return ceiling_q26;
}

void Machine::take_chunk(const Chunk& chunk) {
    if (chunk.is_first()) {
        open_stream(chunk);
    } else if (chunk.is_replacement()) {
        path_.cut(path_.find(chunk.from_us()));
    }
    for (uint16_t k = chunk.begin(); k < chunk.knots(); ++k) chunk.read_knot(k, &path_.append());
    const bool rests = chunk.is_replacement() && chunk.ends_at_rest();
    path_.accept(chunk.is_last() ? Ending::Last
                 : rests         ? Ending::Rest
                                 : Ending::Open,
                 rests ? static_cast<uint64_t>(chunk.tail()) * chunk.tail_dt_us() : 0);
    streams_.take(chunk.seq());
}

void Machine::open_stream(const Chunk& chunk) {
    Knot knot{};
    chunk.read_knot(0, &knot);
    path_.start(knot, speed_q30());
    // The slots that are under way still belong to the stream before.
    for (Point& point : points_) {
        point.play_us = 0;
        point.is_end = point.is_starved = false;
    }
    for (uint8_t j = 0; j < rules_.joints; ++j) start_q8_[j] = knot.position[j];
    is_opening_ = true;
    streams_.open(chunk.stream());
    stepper_.watch();
    awaits_first_pulse_ = true;
    alive_us_ = now_us_;
    mode_ = Mode::Run;
}

void Machine::acknowledge(const Chunk& chunk, const Verdict& verdict) {
    Acknowledgement ack{};
    ack.stream = chunk.stream();
    ack.seq = chunk.seq();
    ack.next_seq = chunk.stream() == streams_.stream() ? streams_.next_seq() : 0;
    ack.verdict = verdict;
    ack.credits = path_.space();
    ack.buffered_ms = buffered_ms();
    ack.t_us = now_us_;
    reporter_.acknowledge(ack);
}

void Machine::receive_heartbeat(const Frame& frame, const Arrival& arrival) {
    if (frame.size != kHeaderSize + 8 || arrival.is_retained) {
        ++bad_frames_;
        return;
    }
    if (frame.boot_id() != 0 && frame.boot_id() != identity_.boot_id) return;
    const uint32_t session = load_u32(frame.bytes + 8), counter = load_u32(frame.bytes + 12);
    const bool is_same = has_session_ && session == session_;
    // A late or repeated beat is no sign of life, and one from far ahead would make all that follow late.
    const uint32_t newest = arrival.received_us > beat_us_ + kSilenceUs ? INT32_MAX : kMostMissed;
    if (is_same && counter - counter_ - 1 >= newest) return;
    beat_us_ = arrival.received_us;
    has_session_ = true;
    session_ = session;
    counter_ = counter;
    if (arrival.received_us > alive_us_) alive_us_ = arrival.received_us;
}

bool Machine::subscribes_anew(uint64_t now_us) {
    const uint64_t since_us = beat_us_ > subscribed_us_ ? beat_us_ : subscribed_us_;
    if (now_us < since_us + kSubscribeAgainUs) return false;
    subscribed_us_ = now_us;
    return true;
}

void Machine::receive_sync(const Frame& frame, const Arrival& arrival) {
    if (frame.size != kHeaderSize + 8 || arrival.is_retained) {
        ++bad_frames_;
        return;
    }
    reporter_.answer_sync(load_u64(frame.bytes + 8), arrival.received_us, now_us_);
}

// Between two pieces the arm may be armed and moved as ever: the next piece is refused then, and waits.
void Machine::receive_update(const Frame& frame, const Arrival& arrival) {
    UpdateAnswer answer;
    const bool is_free = keeps_still() && !is_armed_;
    if (!update_.receive(frame, identity_.boot_id, arrival.is_retained, is_free, &answer)) return count_bad_frame();
    reporter_.acknowledge_update(answer);
}

}  // namespace gemelo
