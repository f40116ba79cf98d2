#include "text_mode.h"

#include "phrase.h"

namespace gemelo {
namespace {

constexpr uint64_t kSilenceUs = 1000000;  // chosen

const char* name_of(Code code) {
    constexpr const char* kNames[] = {"OK",
                                      "DUPLICATE",
                                      "GAP",
                                      "NO_SPACE",
                                      "BAD_DT",
                                      "POSITION_LIMIT",
                                      "VELOCITY_LIMIT",
                                      "START_MISMATCH",
                                      "WRONG_BOOT",
                                      "EXPIRED",
                                      "RETAINED",
                                      "BAD_JOINTS",
                                      "NOT_READY",
                                      "WRONG_STREAM",
                                      "NOT_AT_REST",
                                      "UNKNOWN_CMD",
                                      "BAD_COUNT",
                                      "NOT_ARMED",
                                      "ESTOP_PRESSED",
                                      "NO_HOMING",
                                      "BAD_ARGUMENT",
                                      "ACCELERATION_LIMIT"};
    return kNames[static_cast<uint8_t>(code)];
}

}  // namespace

void TextMode::receive(const TextLine& line, uint64_t now_us) {
    // Late lines do not count as heard: a sender that began anew at once is believed after that time.
    if (now_us - heard_us_ >= kSilenceUs) has_seq_ = false;
    const bool is_readable = line.code == Code::Ok;
    const int32_t ahead = static_cast<int32_t>(line.seq - seq_);
    if (has_seq_ && is_readable && ahead < 0) {
        ++late_;
        return acknowledge(line.seq, now_us);
    }
    if (has_seq_ && ahead == 0 && was_followed_) {
        heard_us_ = now_us;
        return acknowledge(line.seq, placed_us_);
    }
    const Code code = is_readable ? machine_->follow(line.target_q8, now_us) : line.code;
    // The number of a line that is damaged is believed only where it is the one that was due.
    if (is_readable || (has_seq_ && ahead == 1)) place(line.seq, code == Code::Ok, now_us);
    code == Code::Ok ? acknowledge(line.seq, now_us) : refuse(line.seq, code);
}

void TextMode::place(uint32_t seq, bool was_followed, uint64_t now_us) {
    const uint32_t ahead = seq - seq_;
    const bool is_gap = has_seq_ && ahead > 1;
    seq_ = seq;
    has_seq_ = true;
    was_followed_ = was_followed;
    placed_us_ = heard_us_ = now_us;
    if (!is_gap) return;
    lost_ += ahead - 1;
    machine_->report_text_lost(lost_);
}

void TextMode::acknowledge(uint32_t seq, uint64_t t_us) {
    char text[48];
    say(text, Phrase(text, sizeof text).add("<ACK,").add(seq).add(",").add(t_us).add(">\n").size());
}

void TextMode::refuse(uint32_t seq, Code code) {
    char text[48];
    say(text, Phrase(text, sizeof text).add("<NAK,").add(seq).add(",").add(name_of(code)).add(">\n").size());
}

void TextMode::say(const char* text, size_t size) {
    machine_->say(Output::Text, reinterpret_cast<const uint8_t*>(text), size);
}

}  // namespace gemelo
