#include <string>

#include "bytes.h"
#include "frame.h"
#include "frames.h"
#include "play.h"

using namespace gemelo;

namespace fuzz {
namespace {

Bytes text(const std::string& words) { return Bytes(words.begin(), words.end()); }

Item slots(uint8_t count) { return {Kind::Slots, {count}}; }
Item silence(uint8_t count) { return {Kind::Silence, {count}}; }
Item levels(uint8_t bits) { return {Kind::Levels, {bits}}; }

Bytes chunk(uint32_t seq, int32_t from, int32_t to, bool first, bool last, uint32_t stream = 7) {
    rig::ChunkSpec spec;
    spec.stream = stream;
    spec.seq = seq;
    spec.first = first;
    spec.last = last;
    const int32_t middle = from + (to - from) / 2;
    if (first) spec.rows.push_back({{from, 0}, {0, 0}});
    spec.rows.push_back({{middle, 0}, {(to - from) * 20, 0}});
    spec.rows.push_back({{to, 0}, {0, 0}});
    spec.dt_us = 40000;
    return rig::build(spec);
}

// One joint's path with REPLACE from the knot at `from_us`: rows of position and velocity, 40 ms apart, the last one a
// tail.
Bytes replacement(uint32_t seq, uint64_t from_us, const std::vector<std::pair<int32_t, int32_t>>& rows,
                  bool last = false) {
    rig::ChunkSpec spec;
    spec.seq = seq;
    spec.first = seq == 0;
    spec.last = last;
    spec.dt_us = 40000;
    spec.replacing = rig::Replacing{from_us, 1, 40000};
    for (const auto& [position, velocity] : rows) spec.rows.push_back({{position, 0}, {velocity, 0}});
    return rig::build(spec);
}

Bytes command(Command what, uint32_t id, uint16_t argument = 0, const std::vector<int32_t>& position = {}) {
    return rig::build_command(what, id, position, rig::kNever, rig::kBoot, 0, argument);
}

Bytes json_frame(FrameType type, const std::string& words) {
    Bytes bytes(kHeaderSize);
    write_header(bytes.data(), type, 0, 0);
    bytes.insert(bytes.end(), words.begin(), words.end());
    return rig::seal(bytes);
}

// Bytes of an image for a virtual device.
Bytes image(size_t from, size_t to) {
    Bytes bytes(64, 7);
    bytes[0] = kImageMagic;
    store_u16(&bytes[kImageChipOffset], kVirtualChip);
    return Bytes(bytes.begin() + static_cast<long>(from), bytes.begin() + static_cast<long>(to));
}

const char* const kSmall =
    R"({"name":"x","joints":[{"name":"q1","lower_q8":-9000,"upper_q8":9000,"max_velocity_q8":9000,)"
    R"("max_acceleration_q8":9000,"step_pin":1,"dir_pin":2,"text_scale_q32":4294967296,"homing":{"input":0,"group":1,)"
    R"("direction":1,"fast_q8":900,"slow_q8":90,"back_off_q8":10,"position_q8":9005,"max_travel_q8":99999,)"
    R"("timeout_ms":1000}}],"tick_hz":20000,"queue_capacity":4,"state_hz":1000,"sensor_hz":100,"armed_at_boot":false,)"
    R"("enable_pin":5,"inputs":[{"name":"h","pin":21,"role":"home","joint":0,"pull":"up","inverted":true}],)"
    R"("outputs":[{"name":"o","pin":9}],"sensors":[{"name":"s","kind":"analog","pin":8,"scale_q16":65536,)"
    R"("offset_milli":-5}]})";

}  // namespace

std::vector<std::vector<Item>> seeds() {
    const Item beat{Kind::Frame, rig::build_heartbeat(1, 1)}, later_beat{Kind::Frame, rig::build_heartbeat(1, 2)};
    const Item first{Kind::Frame, chunk(0, 0, 2560, true, false)}, second{Kind::Frame, chunk(1, 2560, 0, false, true)};
    const Item live{Kind::Frame, replacement(0, 0, {{0, 0}, {1280, 51200}, {2560, 0}})},
        on{Kind::Frame, replacement(3, 40000, {{1280, 51200}, {3328, 51200}, {4352, 0}})};
    std::vector<std::vector<Item>> all = {
        {beat, first, slots(30), second, slots(60), later_beat, silence(20)},
        {first,
         slots(40),
         {Kind::Frame, command(Command::Hold, 1)},
         slots(60),
         {Kind::Frame, command(Command::Resume, 2)},
         slots(60),
         {Kind::Frame, command(Command::Stop, 3)},
         silence(30)},
        {first,
         slots(50),
         levels(1),
         slots(9),
         levels(0),
         {Kind::Frame, command(Command::Reset, 1)},
         {Kind::Frame, command(Command::Arm, 2)},
         {Kind::Frame, command(Command::Reference, 3, 0, {0, 0})},
         {Kind::Frame, chunk(0, 0, 256, true, true, 8)},
         silence(9)},
        {{Kind::Frame, command(Command::Home, 1)},
         slots(50),
         levels(2),
         slots(50),
         levels(0),
         slots(50),
         levels(2),
         silence(20),
         levels(0),
         silence(60)},
        {{Kind::Line, text("<1,0.01,0.02>")},
         slots(20),
         {Kind::Line, text("<2,-0.05,0.1>")},
         slots(40),
         {Kind::Line, text("<2,-0.05,0.1>")},
         {Kind::Line, text("<4,0.000000001,+.5>\r")},
         silence(60)},
        {{Kind::Frame, command(Command::Disarm, 1)},
         {Kind::Config, text(kSmall)},
         slots(5),
         {Kind::Packet, command(Command::Arm, 2)},
         slots(5),
         {Kind::Packet, command(Command::Home, 3)},
         slots(60)},
        {{Kind::Frame, command(Command::Output, 1, 1)},
         {Kind::Frame, command(Command::Speed, 2, 500)},
         first,
         slots(63),
         {Kind::Retained, command(Command::Hold, 3)},
         {Kind::Frame, rig::build_sync(5)},
         silence(9)},
        {{Kind::Frame, command(Command::Disarm, 1)},
         {Kind::Frame, rig::build_update(UpdateStep::Begin, 5, 0, rig::build_update_begin(64, 1))},
         {Kind::Frame, rig::build_update(UpdateStep::Data, 5, 0, image(0, 40))},
         {Kind::Packet, rig::build_update(UpdateStep::Data, 5, 40, image(40, 64))},
         {Kind::Frame, rig::build_update(UpdateStep::End, 5)}},
        {{Kind::Frame, command(Command::Disarm, 1)},
         {Kind::Packet, rig::build_update(UpdateStep::Begin, 5, 0, rig::build_update_begin(64, 1))},
         {Kind::Frame, rig::build_update(UpdateStep::Data, 5, 0, image(0, 40))},
         {Kind::Frame, rig::build_update(UpdateStep::Begin, 6, 0, rig::build_update_begin(64, 1))},
         {Kind::Frame, rig::build_update(UpdateStep::Data, 6, 0, image(0, 40))},
         {Kind::Frame, rig::build_update(UpdateStep::Abort, 6)},
         {Kind::Frame, command(Command::Arm, 2)},
         {Kind::Retained, rig::build_update(UpdateStep::Begin, 7, 0, rig::build_update_begin(64, 1))}},
        {{Kind::Packet, rig::build_sync(5)},
         {Kind::Packet, json_frame(FrameType::Config, kSmall)},
         {Kind::Packet, json_frame(FrameType::Provision, "{}")},
         {Kind::Packet, chunk(0, 0, 1280, true, true)},
         slots(60)},
        {{Kind::Provision,
          text(
              R"({"device":"rm1","wifi_ssid":"n","wifi_password":"s\u00e9cretsecret","mqtt_uri":)"
              R"("mqtts://h:8883","mqtt_user":"u","mqtt_password":"p","mqtt_ca":"PEM","mqtt_certificate":"PEM","mqtt_key":"PEM","update_key":"PEM","factory_reset":false})")}},
        {{Kind::Json, text(kSmall)}},
        {{Kind::Json, text(R"({"a":[1,-2,{"b":"\ud83d\ude00"}],"c":null,"d":true})")}},
        {{Kind::Serial, Bytes{0, 2, 0x67, 0, '<', '1', ',', '0', '.', '1', ',', '0', '>', '\n', 0xff, 0, 0}},
         slots(30)},
        {{Kind::Frame, command(Command::Disarm, 1)},
         levels(4),
         {Kind::Frame, command(Command::Arm, 2)},
         {Kind::Frame, command(Command::Reference, 3, 0, {256, -256})},
         {Kind::Line, text("<9,0,0>")},
         silence(60)},
        {beat,
         live,
         slots(20),
         on,
         on,
         slots(63),
         slots(63),
         {Kind::Frame, replacement(4, 120000, {{4352, 0}, {4352, 0}}, true)},
         silence(9)},
        {live,
         slots(20),
         {Kind::Frame, command(Command::Hold, 1)},
         on,
         slots(20),
         {Kind::Frame, command(Command::Speed, 2, 300)},
         {Kind::Frame, command(Command::Resume, 3)},
         slots(9),
         {Kind::Frame, replacement(9, 80000, {{3328, 51200}, {5376, 51200}, {6400, 0}})},
         {Kind::Packet, chunk(10, 6400, 7680, false, true)},
         silence(30)},
    };
    return all;
}

}  // namespace fuzz
