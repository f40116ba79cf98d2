#include "player.h"

using namespace gemelo;

namespace {

constexpr uint32_t kLeadUs = 500000;
constexpr uint32_t kBeatMs = 200;
constexpr uint8_t kFirstSwitchPin = 30;  // the switches cross from the lower word of the pins to the upper one
constexpr uint8_t kLimitPin = 40;
constexpr uint8_t kButtonPin = 41;
constexpr int32_t kSwitchAt = 300;  // steps

// A switch for every joint, at 300 steps; one that ends the first joint's travel; an e-stop that is active at low
// level.
void add_inputs(DeviceConfig* config) {
    for (uint8_t j = 0; j < config->joints; ++j) {
        InputConfig& input = config->input[j];
        input.name[0] = 's';
        input.name[1] = static_cast<char>('1' + j);
        input.pin = kFirstSwitchPin + j;
        input.role = InputRole::Home;
        input.joint = j;
    }
    InputConfig& limit = config->input[config->joints];
    limit.name[0] = 'l';
    limit.pin = kLimitPin;
    limit.role = InputRole::LimitUpper;
    limit.joint = 0;
    InputConfig& button = config->input[config->joints + 1];
    button.name[0] = 'b';
    button.pin = kButtonPin;
    button.role = InputRole::EStop;
    button.is_inverted = 1;
    config->inputs = static_cast<uint8_t>(config->joints + 2);
}

HomingConfig homing(uint8_t joint) {
    HomingConfig homing{};
    homing.input = joint;
    homing.group = joint % 2;
    homing.direction = joint % 3 == 0 ? 1 : -1;
    homing.fast_q8 = 1500 * 256;
    homing.slow_q8 = 200 * 256;
    homing.back_off_q8 = 40 * 256;
    homing.position_q8 = homing.direction * kSwitchAt * 256;
    homing.max_travel_q8 = 4000 * 256;
    homing.timeout_ms = 10000;
    return homing;
}

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
    add_inputs(&config);
    for (uint8_t j = 0; j < joints; ++j) {
        JointConfig& joint = config.joint[j];
        joint.name[0] = 'q';
        joint.name[1] = static_cast<char>('1' + j);
        joint.lower_q8 = -100000 * 256;
        joint.upper_q8 = 100000 * 256;
        joint.max_velocity_q8 = joint.max_acceleration_q8 = 4000 * 256;
        joint.dir_setup_us = 5;
        joint.is_inverted = j % 2;
        joint.homing = homing(j);
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
    is_feeding_ = move.stream != 0;
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
        case Deed::Replace:
            return replace(move);
        case Deed::Home:
            return send(command(Command::Home, ++commands_));
        case Deed::Reset:
            return send(command(Command::Reset, ++commands_));
        case Deed::Arm:
            return send(command(Command::Arm, ++commands_));
        case Deed::Slow:
            return send(command(Command::Speed, ++commands_, 300));
        case Deed::Full:
            return send(command(Command::Speed, ++commands_, 1000));
        case Deed::PressButton:
        case Deed::ReleaseButton:
            is_button_pressed_ = deed == Deed::PressButton;
            return;
        case Deed::CloseLimit:
        case Deed::OpenLimit:
            is_limit_closed_ = deed == Deed::CloseLimit;
            return;
        case Deed::StopFeeding:
        case Deed::Feed:
            is_feeding_ = deed == Deed::Feed;
            return;
        case Deed::End:
            return;
    }
}

uint64_t Player::played_us(const Move& move) const {
    const Point& present = machine_.present();
    return present.stream == move.stream ? present.play_us : 0;
}

// From the second knot ahead.
void Player::replace(const Move& move) {
    const uint16_t first = static_cast<uint16_t>(played_us(move) / kDtUs + 2);
    send(move.replacement(first, seq_++));
    next_knot_ = static_cast<uint16_t>(first + kReplacingKnots + 1);
}

void Player::feed(const Move& move) {
    const uint64_t until_us = played_us(move) + kLeadUs;
    while (next_knot_ <= kLastKnot && next_knot_ * kDtUs < until_us) {
        send(move.chunk(next_knot_, seq_++));
        next_knot_ = static_cast<uint16_t>(next_knot_ + kChunkKnots);
    }
}

// As on the chip: the slot task runs once per slot, after its first tick.
void Player::run_ms() {
    const uint32_t ticks = ticks_per_slot(config_);
    for (uint32_t tick = 0; tick < ticks; ++tick) {
        const Levels levels = read_pins();
        watch_.tick(machine_, levels);
        turn_shafts();
        if (tick == 0) watch_.slot(machine_, now_us_);
    }
    now_us_ += kSlotUs;
}

// Where the pulses have brought the shafts; the device may count otherwise.
void Player::turn_shafts() {
    const Pins& pins = machine_.stepper().pins();
    const uint32_t rises = pins.step & ~step_;
    step_ = pins.step;
    for (uint8_t j = 0; j < config_.joints; ++j) {
        if (((rises >> j) & 1) == 0) continue;
        shaft_[j] += ((pins.dir >> j) & 1) != config_.joint[j].is_inverted ? 1 : -1;
    }
}

Levels Player::read_pins() const {
    uint64_t levels = static_cast<uint64_t>(is_button_pressed_ ? 0 : 1) << kButtonPin;
    if (is_limit_closed_) levels |= 1ull << kLimitPin;
    for (uint8_t j = 0; j < config_.joints; ++j) {
        if (config_.joint[j].homing.direction * shaft_[j] >= kSwitchAt) levels |= 1ull << (kFirstSwitchPin + j);
    }
    return Levels{static_cast<uint32_t>(levels), static_cast<uint32_t>(levels >> 32)};
}

void Player::send(const Wire& wire) {
    watch_.receive(machine_, Arrival{wire.bytes, wire.size, false, now_us_}, now_us_);
}
