#include "player.h"

using namespace gemelo;

namespace {

constexpr uint32_t kLeadUs = 500000;
constexpr uint32_t kBeatMs = 200;

// Joints that do 4000 steps/s after a second; every other one turns the other way.
DeviceConfig device(uint8_t joints) {
    DeviceConfig config{};
    config.name[0] = 'r';
    config.tick_hz = 50000;
    config.queue_capacity = kMaxKnots;
    config.state_hz = 50;
    config.sensor_hz = 10;
    config.is_armed_at_boot = 1;
    config.hold_timeout_ms = 500;
    config.joints = joints;
    for (uint8_t j = 0; j < joints; ++j) {
        JointConfig& joint = config.joint[j];
        joint.name[0] = 'q';
        joint.name[1] = static_cast<char>('1' + j);
        joint.lower_q8 = -100000 * 256;
        joint.upper_q8 = 100000 * 256;
        joint.max_velocity_q8 = joint.max_acceleration_q8 = 4000 * 256;
        joint.dir_setup_us = 5;
        joint.is_inverted = j % 2;
    }
    return config;
}

}  // namespace

Player::Player(uint8_t joints, Watch& watch) : watch_(watch), config_(device(joints)) {
    machine_.begin(config_, Identity{kBoot, "power_on"}, Sink{this, said});
    const int32_t steps[kMaxJoints] = {};
    machine_.start(0, steps, true);
}

void Player::said(void* self, Output output, const uint8_t* bytes, size_t size) {
    static_cast<Player*>(self)->watch_.hear(output, bytes, size);
}

void Player::play(const Move& move, const Cue* script) {
    seq_ = next_knot_ = 0;
    is_feeding_ = true;
    for (uint32_t ms = 0;; ++ms) {
        for (; script->at_ms == ms; ++script) {
            if (script->deed == Deed::End) return;
            act(move, script->deed);
        }
        if (ms % kBeatMs == 0) send(heartbeat(++beats_));
        if (is_feeding_) feed(move);
        run_ms();
        watch_.look(machine_, ms);
    }
}

void Player::act(const Move& move, Deed deed) {
    switch (deed) {
        case Deed::Hold:
            return send(command(Command::Hold, ++commands_));
        case Deed::Resume:
            return send(command(Command::Resume, ++commands_));
        case Deed::RepeatChunk:
            return send(move.chunk(static_cast<uint16_t>(next_knot_ - kChunkKnots), seq_ - 1));
        case Deed::SkipChunk:
            return send(move.chunk(static_cast<uint16_t>(next_knot_ + kChunkKnots), seq_ + 1));
        case Deed::StopFeeding:
        case Deed::Feed:
            is_feeding_ = deed == Deed::Feed;
            return;
        case Deed::End:
            return;
    }
}

void Player::feed(const Move& move) {
    const Point& present = machine_.present();
    const uint64_t played_us = present.stream == move.stream ? present.play_us : 0;
    while (next_knot_ <= kLastKnot && next_knot_ * kDtUs < played_us + kLeadUs) {
        send(move.chunk(next_knot_, seq_++));
        next_knot_ = static_cast<uint16_t>(next_knot_ + kChunkKnots);
    }
}

// As on the chip: the slot task runs once per slot, after its first tick.
void Player::run_ms() {
    const uint32_t ticks = ticks_per_slot(config_);
    for (uint32_t tick = 0; tick < ticks; ++tick) {
        watch_.tick(machine_);
        if (tick == 0) watch_.slot(machine_, now_us_);
    }
    now_us_ += kSlotUs;
}

void Player::send(const Wire& wire) { machine_.receive(Arrival{wire.bytes, wire.size, false, now_us_}, now_us_); }
