#include "play.h"

#include <stdlib.h>
#include <string.h>

#include <memory>

#include "bytes.h"
#include "config_text.h"
#include "json_reader.h"
#include "phrase.h"
#include "promises.h"
#include "provision.h"
#include "serial.h"

using namespace gemelo;

namespace fuzz {
namespace {

constexpr uint32_t kBoot = 0x12345678;

const char* const kConfig =
    R"({"name":"fuzz","joints":[{"name":"q1","lower_q8":-256000,"upper_q8":256000,"max_velocity_q8":1024000,)"
    R"("max_acceleration_q8":2048000,"dir_setup_us":5,"step_pin":1,"dir_pin":2,"text_scale_q32":1099511628,)"
    R"("homing":{"input":1,"direction":-1,"fast_q8":256000,"slow_q8":51200,"back_off_q8":2560,"position_q8":-250000,)"
    R"("max_travel_q8":300000,"timeout_ms":3000}},)"
    R"({"name":"q2","lower_q8":-51200,"upper_q8":51200,"max_velocity_q8":25600,"max_acceleration_q8":25600,)"
    R"("inverted":true,"step_pin":3,"dir_pin":4,"text_scale_q32":109951163}],)"
    R"("inputs":[{"name":"seta","pin":21,"role":"estop"},{"name":"home_q1","pin":22,"role":"home","joint":0},)"
    R"({"name":"end_q2","pin":23,"role":"limit_upper","joint":1}],)"
    R"("outputs":[{"name":"lamp","pin":24,"off_at_estop":true}],)"
    R"("sensors":[{"name":"ultra","kind":"ultrasonic","pin":26,"trigger_pin":27}]})";

DeviceConfig first_config() {
    DeviceConfig config;
    Refusal refusal;
    PROMISE(parse_config(kConfig, strlen(kConfig), &config, &refusal));
    return config;
}

// What reads the wire's bytes must read the same out of every report that we wrap.
void check_wrapping(const SerialPort& port, Output output, const uint8_t* bytes, size_t size) {
    uint8_t out[SerialPort::kLargestReport];
    const size_t length = port.wrap(output, bytes, size, out, sizeof out);
    PROMISE(length > size || (output == Output::Text && length == size));
    static Packets packets;
    Packets::Found found = Packets::Found::None;
    for (size_t i = 0; i < length; ++i) {
        PROMISE(found == Packets::Found::None);
        found = packets.put(out[i]);
    }
    // An answer is no line that a device would take.
    if (output == Output::Text) return;
    PROMISE(found == Packets::Found::Frame);
    PROMISE(open_frame(packets.bytes(), packets.size()).is_valid());
    const bool is_frame = output <= Output::State;
    PROMISE(packets.size() == size + (is_frame ? 0 : kHeaderSize + kCrcSize));
    PROMISE(memcmp(packets.bytes() + (is_frame ? 0 : kHeaderSize), bytes, size) == 0);
}

// A slot of the flash: it is opened, written and closed in this order, never armed and never in motion.
struct Flash {
    Flash() : slot{this, kVirtualChip, verify, begin, write, finish, abort} {}

    static Flash& of(void* self) {
        Flash& flash = *static_cast<Flash*>(self);
        PROMISE(flash.machine->keeps_still() && !flash.machine->is_enabled());
        return flash;
    }
    static bool answer(bool is_good, Refusal* refusal) {
        if (!is_good) Phrase(refusal->reason, sizeof refusal->reason).add("no");
        return is_good;
    }
    static bool verify(void* self, const uint8_t* digest, const uint8_t* signature, size_t size, Refusal* refusal) {
        of(self);
        PROMISE(size >= 8 && size <= kMaxSignature);
        return answer((signature[size - 1] ^ digest[kDigestSize - 1]) % 16 != 2, refusal);
    }
    static bool begin(void* self, uint32_t size, Refusal* refusal) {
        Flash& flash = of(self);
        PROMISE(!flash.is_open && size >= kImageHeaderSize);
        flash.is_open = size <= 100000;
        flash.left = size;
        return answer(flash.is_open, refusal);
    }
    static bool write(void* self, const uint8_t* bytes, size_t size, Refusal* refusal) {
        Flash& flash = of(self);
        PROMISE(flash.is_open && size > 0 && size <= kMaxUpdatePiece && size <= flash.left);
        flash.left -= size;
        return answer(bytes[size - 1] != 255, refusal);
    }
    static bool finish(void* self, const uint8_t*, Refusal* refusal) {
        Flash& flash = of(self);
        PROMISE(flash.is_open && flash.left == 0);
        flash.is_open = false;
        return answer(!flash.is_done, refusal) && (flash.is_done = true);
    }
    static void abort(void* self) {
        Flash& flash = of(self);
        PROMISE(flash.is_open);
        flash.is_open = false;
    }

    FirmwareSlot slot;
    const Machine* machine = nullptr;
    size_t left = 0;
    bool is_open = false, is_done = false;
};

class Bench {
  public:
    Bench() : config_(first_config()) {
        flash_.machine = &machine_;
        machine_.begin(config_, Identity{kBoot, "power_on", true}, Sink{this, put, keep, nullptr, &flash_.slot});
        port_.begin(machine_, kBoot, other, this);
        const int32_t steps[kMaxJoints] = {};
        machine_.start(now_us_, steps, true);
        slots(1);
    }

    void take(const Item& item);
    const Taken& taken() const { return taken_; }

  private:
    static void put(void* self, Output output, const uint8_t* bytes, size_t size) {
        static_cast<Bench*>(self)->hear(output, bytes, size);
    }
    static void keep(void* self, const uint8_t*, size_t size) {
        PROMISE(static_cast<Bench*>(self)->machine_.keeps_still());
        PROMISE(size <= kMaxConfigText);
    }
    static void other(void*, FrameType type, const uint8_t* text, size_t size) {
        if (type == FrameType::Provision) provision(text, size);
    }
    static void provision(const uint8_t* text, size_t size);
    static void read_json(const Bytes& bytes);

    void hear(Output output, const uint8_t* bytes, size_t size) {
        check_output(output, bytes, size, config_.joints);
        check_wrapping(port_, output, bytes, size);
        if (!is_refusal(output, bytes, size)) has_agreed_ = true;
        if (output == Output::TrajAck && bytes[20] == 0) ++taken_.chunks;
    }
    void deliver(const Item& item);
    void serial(const Bytes& bytes) { port_.receive(bytes.data(), bytes.size(), now_us_, now_us_); }
    void frame(const Bytes& bytes, bool is_retained) {
        const Arrival arrival{bytes.data(), bytes.size(), is_retained, now_us_};
        port_.yield_to_mqtt(arrival);
        const uint64_t chunks = taken_.chunks;
        machine_.receive(arrival, now_us_);
        if (taken_.chunks != chunks && (load_u16(&bytes[30]) & kFlagReplace) != 0) ++taken_.replacements;
    }
    void slots(uint32_t count);
    void slot();
    void check_steps(const int32_t* before, bool was_homing);
    void check_motion();

    DeviceConfig config_;
    Machine machine_;
    Flash flash_;
    SerialPort port_;
    Levels levels_;
    uint8_t unsettled_ = 0;  // slots in which every tick is run
    uint64_t now_us_ = 1000000;
    bool has_agreed_ = false;  // to what came last
    Taken taken_;
    uint8_t moved_ = 0;  // slots in which it has followed a path or a target, one after the other
    int64_t place_q20_[kMaxJoints] = {}, change_q20_[kMaxJoints] = {};
};

void Bench::take(const Item& item) {
    const Mode mode = machine_.mode();
    const bool stood = machine_.keeps_still() && mode != Mode::Hold;
    const bool is_talk = item.kind < Kind::Json;
    int32_t before[kMaxJoints];
    for (uint8_t j = 0; j < config_.joints; ++j) before[j] = machine_.stepper().executed(j);
    has_agreed_ = false;
    deliver(item);
    PROMISE(machine_.mode() <= Mode::EStop);
    // What was refused, or not even understood, moves nothing and changes no mode.
    const bool is_void = is_talk && stood && !has_agreed_;
    if (!is_void) return;
    PROMISE(machine_.mode() == mode);
    if (unsettled_ != 0) return;
    slots(3);
    PROMISE(machine_.mode() == mode);
    for (uint8_t j = 0; j < config_.joints; ++j) PROMISE(machine_.stepper().executed(j) == before[j]);
}

void Bench::deliver(const Item& item) {
    const uint8_t first = item.bytes.empty() ? 0 : item.bytes[0];
    switch (item.kind) {
        case Kind::Frame:
        case Kind::Retained:
            return frame(item.bytes, item.kind == Kind::Retained);
        case Kind::Packet: {
            Bytes packet(cobs_bound(item.bytes.size()));
            CobsWriter writer(packet.data());
            writer.put(item.bytes.data(), item.bytes.size());
            packet.resize(writer.finish());
            return serial(packet);
        }
        case Kind::Serial:
            return serial(item.bytes);
        case Kind::Line: {
            Bytes line = item.bytes;
            line.push_back('\n');
            return serial(line);
        }
        case Kind::Config:
            return machine_.receive_config(Arrival{item.bytes.data(), item.bytes.size(), true, now_us_}, now_us_);
        case Kind::Provision:
            return provision(item.bytes.data(), item.bytes.size());
        case Kind::Json:
            return read_json(item.bytes);
        case Kind::Slots:
            return slots(first % 64);
        case Kind::Levels:
            levels_.low = static_cast<uint32_t>(first & 7) << 21;
            unsettled_ = 2;
            return slots(1);
        default:
            return slots(20u * (first % 64));
    }
}

void Bench::provision(const uint8_t* text, size_t size) {
    static Credentials credentials;
    credentials = Credentials{};
    Refusal refusal;
    const bool is_taken = parse_provision(reinterpret_cast<const char*>(text), size, &credentials, &refusal);
    PROMISE(is_taken == (refusal.reason[0] == 0));
    const char* const secrets[] = {credentials.wifi_password, credentials.mqtt_password};
    for (const char* secret : secrets)
        PROMISE(is_taken || strlen(secret) < 8 || strstr(refusal.reason, secret) == nullptr);
}

// Any walk through any text ends.
void Bench::read_json(const Bytes& bytes) {
    const char* text = reinterpret_cast<const char*>(bytes.data());
    JsonReader reader(text, bytes.size());
    char word[16];
    JsonInteger integer;
    bool truth = false;
    for (size_t i = 0; i < bytes.size() && reader.error() == nullptr; ++i) {
        switch (bytes[i] % 8) {
            case 0:
                reader.open('{');
                break;
            case 1:
                reader.open('[');
                break;
            case 2:
                reader.next(bytes[i] & 8 ? ']' : '}');
                break;
            case 3:
                reader.key(word, sizeof word);
                break;
            case 4:
                reader.text(word, sizeof word);
                break;
            case 5:
                reader.integer(&integer);
                break;
            case 6:
                reader.truth(&truth);
                break;
            default:
                reader.null();
        }
        PROMISE(reader.position() <= bytes.size());
    }
    DeviceConfig config;
    Refusal refusal;
    const bool is_taken = parse_config(text, bytes.size(), &config, &refusal);
    PROMISE(is_taken == (refusal.reason[0] == 0));
    PROMISE(is_taken == (is_taken && find_fault(config).sentence == nullptr));
}

void Bench::slots(uint32_t count) {
    for (uint32_t i = 0; i < count; ++i) slot();
}

void Bench::slot() {
    int32_t before[kMaxJoints];
    for (uint8_t j = 0; j < config_.joints; ++j) before[j] = machine_.stepper().executed(j);
    const bool was_homing = machine_.mode() == Mode::Homing;
    Stepper& stepper = machine_.stepper();
    const uint32_t ticks = ticks_per_slot(config_);
    stepper.tick(levels_);
    machine_.slot(now_us_);
    uint32_t done = 1;
    if (unsettled_ != 0) {
        --unsettled_;
    } else if (stepper.is_quiet()) {
        stepper.skip(ticks - 1);
        done = ticks;
    }
    for (; done < ticks; ++done) stepper.tick(levels_);
    now_us_ += kSlotUs;
    check_steps(before, was_homing);
    check_motion();
}

// From slot to slot no velocity changes by more than limits, bends and roundings of knots 1 ms apart allow: the arm
// brakes, but for what stops it dead.
void Bench::check_motion() {
    const bool moves = machine_.mode() == Mode::Run || machine_.mode() == Mode::Hold;
    const Point& point = machine_.present();
    moved_ = moves && !point.is_start ? static_cast<uint8_t>(moved_ < 9 ? moved_ + 1 : 9) : 0;
    for (uint8_t j = 0; j < config_.joints; ++j) {
        const int64_t change = point.position_q20[j] - place_q20_[j];
        // In Q20 steps a slot: 2.3 times the limit over two slots, and 47 steps/s.
        const int64_t allowed = config_.joint[j].max_acceleration_q8 / 50 + 54000;
        PROMISE(moved_ < 5 || llabs(change - change_q20_[j]) <= allowed);
        place_q20_[j] = point.position_q20[j];
        change_q20_[j] = change;
    }
}

void Bench::check_steps(const int32_t* before, bool was_homing) {
    const Mode mode = machine_.mode();
    const bool is_planned = mode == Mode::Idle || mode == Mode::Run || mode == Mode::Hold;
    for (uint8_t j = 0; j < config_.joints; ++j) {
        const int64_t now = machine_.stepper().executed(j);
        const int64_t most = velocity_limit_q8(config_, j) / 256 * 11 / 10000 + 2;
        // A joint that finds its switch learns where it is.
        PROMISE(was_homing || llabs(now - before[j]) <= most);
        PROMISE(!is_planned || now * 256 >= int64_t{config_.joint[j].lower_q8} - 256);
        PROMISE(!is_planned || now * 256 <= int64_t{config_.joint[j].upper_q8} + 256);
    }
    PROMISE(machine_.max_slot_error_q8() <= 128);
}

}  // namespace

Taken play(const std::vector<Item>& items) {
    // On the heap, so that a sanitizer sees its edges.
    const std::unique_ptr<Bench> bench = std::make_unique<Bench>();
    for (const Item& item : items) bench->take(item);
    return bench->taken();
}

}  // namespace fuzz
