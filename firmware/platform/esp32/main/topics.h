// The topics of PROTOCOL.md: what is heard and what is said.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "phrase.h"
#include "protocol.h"
#include "report.h"

namespace gemelo {

struct Heard {
    const char* name;
    FrameType type;
    uint8_t qos;
};

constexpr Heard kHeard[] = {
    {"traj", FrameType::Traj, 1}, {"cmd", FrameType::Cmd, 1},       {"hb", FrameType::Heartbeat, 0},
    {"sync", FrameType::Sync, 0}, {"config", FrameType::Config, 1}, {"update", FrameType::Update, 1},
};

struct Said {
    const char* name;  // nullptr: not on MQTT
    uint8_t qos;
    bool is_retained;
};

inline Said said(Output output) {
    switch (output) {
        case Output::TrajAck:
            return {"traj/ack", 0, false};
        case Output::CmdAck:
            return {"cmd/ack", 1, false};
        case Output::SyncReply:
            return {"sync/r", 0, false};
        case Output::State:
            return {"state", 0, false};
        case Output::Event:
            return {"event", 1, false};
        case Output::Status:
            return {"status", 1, true};
        case Output::ConfigAck:
            return {"config/ack", 1, false};
        case Output::UpdateAck:
            return {"update/ack", 1, false};
        case Output::Sensors:
            return {"sensors", 0, false};
        default:
            return {nullptr, 0, false};
    }
}

// `gemelo/v1/<device>/`, and topics under it.
class Topics {
  public:
    void begin(const char* device) {
        Phrase text(text_, sizeof text_);
        prefix_ = text.add("gemelo/v1/").add(device).add("/").size();
    }
    // Valid until the next call.
    const char* full(const char* name) {
        Phrase(text_ + prefix_, sizeof text_ - prefix_).add(name);
        return text_;
    }
    // nullptr for a topic that nobody listens to.
    const Heard* find(const char* topic, size_t size) const {
        if (size < prefix_ || memcmp(topic, text_, prefix_) != 0) return nullptr;
        for (const Heard& heard : kHeard)
            if (strlen(heard.name) == size - prefix_ && memcmp(heard.name, topic + prefix_, size - prefix_) == 0)
                return &heard;
        return nullptr;
    }

  private:
    static constexpr size_t kLongestDevice = 31;
    static constexpr size_t kLongestName = 15;
    char text_[10 + kLongestDevice + 1 + kLongestName + 1] = "";
    size_t prefix_ = 0;
};

}  // namespace gemelo
