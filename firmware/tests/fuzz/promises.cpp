#include "promises.h"

#include <string>

#include "frame.h"

using namespace gemelo;

namespace fuzz {
namespace {

// A flat JSON object: texts, numbers, truths and lists of numbers.
class Flat {
  public:
    Flat(const uint8_t* bytes, size_t size) : text_(bytes, bytes + size) {}
    bool is_good() {
        if (!eat('{')) return false;
        do {
            if (!text() || !eat(':') || !value()) return false;
        } while (eat(','));
        return eat('}') && at_ == text_.size();
    }

  private:
    bool eat(char c) {
        while (at_ < text_.size() && text_[at_] == ' ') ++at_;
        if (at_ >= text_.size() || text_[at_] != c) return false;
        ++at_;
        return true;
    }
    bool text() {
        if (!eat('"')) return false;
        for (; at_ < text_.size() && text_[at_] != '"'; ++at_) {
            if (static_cast<uint8_t>(text_[at_]) < 0x20) return false;
            if (text_[at_] == '\\') ++at_;
        }
        return at_ < text_.size() && text_[at_++] == '"';
    }
    bool value() {
        if (eat('"')) return --at_, text();
        if (eat('[')) {
            do {
                if (!word()) return false;
            } while (eat(','));
            return eat(']');
        }
        return word();
    }
    bool word() {
        eat(' ');
        const size_t start = at_;
        while (at_ < text_.size() &&
               (isalnum(static_cast<uint8_t>(text_[at_])) || text_[at_] == '-' || text_[at_] == '.'))
            ++at_;
        return at_ > start;
    }

    std::string text_;
    size_t at_ = 0;
};

void check_frame(FrameType type, size_t length, const uint8_t* bytes, size_t size) {
    const Frame frame = open_frame(bytes, size);
    PROMISE(frame.is_valid());
    PROMISE(frame.type() == type);
    PROMISE(frame.size == length);
}

}  // namespace

void check_output(Output output, const uint8_t* bytes, size_t size, uint8_t joints) {
    switch (output) {
        case Output::TrajAck:
            return check_frame(FrameType::Ack, 44, bytes, size);
        case Output::CmdAck:
            return check_frame(FrameType::CmdAck, 24, bytes, size);
        case Output::SyncReply:
            return check_frame(FrameType::SyncReply, 32, bytes, size);
        case Output::State:
            return check_frame(FrameType::State, 60 + 8 * static_cast<size_t>(joints), bytes, size);
        case Output::Text: {
            const std::string line(bytes, bytes + size);
            PROMISE(line.compare(0, 5, "<ACK,") == 0 || line.compare(0, 5, "<NAK,") == 0);
            PROMISE(line.size() > 8 && line.find(">\n") == line.size() - 2);
            return;
        }
        default:
            PROMISE(Flat(bytes, size).is_good());
    }
}

bool is_refusal(Output output, const uint8_t* bytes, size_t size) {
    const std::string text(bytes, bytes + size);
    switch (output) {
        case Output::TrajAck:
            return bytes[20] != 0;
        case Output::CmdAck:
            return bytes[13] != 0;
        case Output::Text:
            return text.compare(0, 5, "<NAK,") == 0;
        case Output::ConfigAck:
        case Output::UpdateAck:
            return text.find("\"accepted\": false") != std::string::npos;
        default:
            return false;
    }
}

}  // namespace fuzz
