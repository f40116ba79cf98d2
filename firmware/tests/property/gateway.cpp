#include "gateway.h"

using namespace gemelo;

namespace property {

Gateway::Gateway(Stand& stand, uint32_t boot_id, uint64_t seed, bool repeats)
    : stand_(stand), boot_id_(boot_id), dice_(seed), repeats_(repeats) {}

void Gateway::work() {
    if (is_beating && stand_.now_us() >= next_beat_us_) {
        stand_.beat();
        next_beat_us_ = stand_.now_us() + 200000;
    }
    if (path_ && is_feeding) send_due();
    if (live_ && is_feeding) send_live();
    deliver_due();
}

bool Gateway::is_done() const {
    if (live_) return live_->is_over();
    return path_ && path_->is_over() && taken_ == chunks_.size();
}

const std::vector<int32_t>& Gateway::target() const {
    return live_ ? live_->target().position : chunks_.back().rows.back().position;
}

void Gateway::end_stream() {
    if (path_) path_->end();
    is_ending_ = true;
}

// From where the path stands, or from the whole step there: a gateway may know no better.
void Gateway::open_stream(bool is_live) {
    std::vector<int32_t> start;
    const bool knows_better = dice_.chance(0.5);
    for (uint8_t j = 0; j < stand_.bench.config.joints; ++j) {
        const int64_t q20 = stand_.machine.present().position_q20[j];
        const int64_t whole = ((q20 + kFineStep / 2) >> kFineBits) * 256;
        start.push_back(knows_better ? as_q8(q20) : static_cast<int32_t>(whole));
    }
    const uint64_t seed = static_cast<uint64_t>(dice_.between(0, INT64_MAX / 2));
    if (is_live) {
        live_.emplace(stand_.bench.config, start, seed);
    } else {
        path_.emplace(stand_.bench.config, start, seed);
    }
    is_ending_ = false;
    wrong_.clear();
    chunks_.clear();
    begins_us_.assign(1, 0);
    next_ = taken_ = 0;
    lead_us_ = static_cast<uint64_t>(dice_.logarithmic(50000, 2500000));
    heard_us_ = stand_.now_us();
    ++stream_;
}

void Gateway::forget_stream() {
    if (taken_ == 0) link_.clear();  // what might still open it
    path_.reset();
    live_.reset();
}

uint64_t Gateway::played_us() const {
    const Point& present = stand_.machine.present();
    return present.stream == stream_ ? present.play_us : 0;
}

// The first message again and again until it is taken; of all others each once, at moments of their own.
void Gateway::send_live() {
    if (live_->is_over() && is_ending_) return;
    if (stand_.now_us() < next_live_us_) return;
    next_live_us_ = stand_.now_us() + static_cast<uint64_t>(dice_.between(1000, 60000));
    if (taken_ == 0 && !chunks_.empty()) return post(rig::build(chunks_[0]));
    const bool is_wrong = taken_ != 0 && dice_.chance(0.05);
    const uint64_t from_us = played_us() + static_cast<uint64_t>(dice_.between(2000, 100000));
    rig::ChunkSpec chunk = is_wrong ? live_->wrong_message(played_us())
                                    : live_->message(taken_ == 0 ? 0 : from_us, is_ending_ || dice_.chance(0.02));
    chunk.stream = stream_;
    chunk.seq = static_cast<uint32_t>(chunks_.size());
    chunk.first = chunks_.empty();
    chunk.boot_id = boot_id_;
    if (is_wrong) wrong_.insert(chunk.seq);
    chunks_.push_back(chunk);
    post(rig::build(chunk));
}

void Gateway::send_due() {
    if (stand_.now_us() > heard_us_ + 150000) {  // an answer is missing
        next_ = taken_;
        heard_us_ = stand_.now_us();
    }
    if (stand_.now_us() < full_until_us_) return;
    for (int i = 0; i < 3; ++i) {
        if (next_ == chunks_.size()) {
            if (path_->is_over() || begins_us_.back() > played_us() + lead_us_) return;
            rig::ChunkSpec chunk = path_->next();
            chunk.stream = stream_;
            chunk.seq = static_cast<uint32_t>(next_);
            chunk.boot_id = boot_id_;
            const size_t spans = chunk.rows.size() - (chunk.first ? 1 : 0);
            begins_us_.push_back(begins_us_.back() + spans * chunk.dt_us);
            chunks_.push_back(chunk);
        }
        post(rig::build(chunks_[next_++]));
    }
}

void Gateway::post(const rig::Bytes& frame) {
    said_.push_back(frame);
    if (dice_.chance(0.04)) return;
    const uint64_t late_us = dice_.chance(0.2) ? static_cast<uint64_t>(dice_.between(0, 60000)) : 0;
    link_.push_back(Letter{stand_.now_us() + late_us, frame});
    if (dice_.chance(0.05)) link_.push_back(Letter{stand_.now_us() + 100000, frame});
}

void Gateway::deliver_due() {
    for (size_t i = 0; i < link_.size();) {
        if (link_[i].due_us > stand_.now_us()) {
            ++i;
            continue;
        }
        const rig::Bytes frame = link_[i].frame;
        link_.erase(link_.begin() + static_cast<std::ptrdiff_t>(i));
        deliver(frame);
    }
}

void Gateway::deliver(const rig::Bytes& frame) {
    stand_.deliver(frame);
    const ChunkAnswer answer = stand_.chunk_answer.value();
    if (repeats_) {
        stand_.deliver(frame);
        if (answer.code == Code::Ok && stand_.chunk_answer->code != Code::Duplicate)
            stand_.findings.add(Property::Idempotence, "a repeated chunk is answered with ",
                                static_cast<int>(stand_.chunk_answer->code));
    }
    hear(answer);
}

void Gateway::hear(const ChunkAnswer& answer) {
    if (!has_stream() || answer.stream != stream_) {
        if (answer.code == Code::Ok)
            stand_.findings.add(Property::Answers, "chunk ", answer.seq, " of a stream that is over is taken");
        return;
    }
    switch (answer.code) {
        case Code::Ok:
            return take(answer.seq);
        case Code::Gap:
            next_ = answer.next_seq;
            return;
        case Code::NoSpace:
            next_ = taken_;
            full_until_us_ = stand_.now_us() + 20000;
            return;
        case Code::Duplicate:
        case Code::NotReady:
        case Code::WrongStream:
            return;
        default:
            if (!may_say(answer))
                stand_.findings.add(Property::Answers, "a feasible chunk is refused with ",
                                    static_cast<int>(answer.code));
    }
}

// Of a message that comes late, or behind one that was lost; and of a path without a stop.
bool Gateway::may_say(const ChunkAnswer& answer) const {
    if (!live_) return false;
    if (answer.code == Code::Late || answer.code == Code::OtherKnot) return true;
    return answer.code == Code::NoStop && chunks_[answer.seq].replacing->tail == 0;
}

void Gateway::take(uint32_t seq) {
    const rig::ChunkSpec& chunk = chunks_[seq];
    if (wrong_.count(seq) != 0) stand_.findings.add(Property::Answers, "a wrong replacement is taken");
    if (seq == 0) {
        PlayedPath path;
        path.begin(chunk);
        stand_.inspector->expect_stream(stream_, path);
        stand_.watch_first_pulse();
    } else if (live_) {
        stand_.inspector->path().replace(chunk);
    } else {
        stand_.inspector->path().add(chunk);
    }
    if (live_) live_->take(chunk);
    taken_ = seq + 1;
    heard_us_ = stand_.now_us();
}

Code Gateway::command(Command command, uint16_t argument, const std::vector<int32_t>& position) {
    const rig::Bytes frame = rig::build_command(command, ++commands_, position, rig::kNever, boot_id_, 0, argument);
    said_.push_back(frame);
    stand_.deliver(frame);
    const Code code = stand_.command_answer.value();
    judged_.push_back(Judged{frame, code});
    if (judged_.size() > 12) judged_.pop_front();
    if (!repeats_) return code;
    for (const Judged& judged : judged_) {
        stand_.deliver(judged.frame);
        if (stand_.command_answer != judged.code)
            stand_.findings.add(Property::Idempotence, "a repeated command is answered with ",
                                static_cast<int>(stand_.command_answer.value()));
    }
    return code;
}

}  // namespace property
