// A configuration as JSON: what is taken, and with which words the rest is refused.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "config_text.h"

using namespace gemelo;

namespace {

const std::string kJoint =
    R"({"name":"q1","lower_q8":-1000,"upper_q8":2000,"max_velocity_q8":512000,"max_acceleration_q8":700,)"
    R"("inverted":true,"dir_setup_us":5,"step_pin":1,"dir_pin":2,"text_scale_q32":9000000000,)"
    R"("homing":{"input":0,"group":3,"direction":-1,"fast_q8":256,"slow_q8":25,"back_off_q8":100,"position_q8":-1050,)"
    R"("max_travel_q8":4000,"timeout_ms":9000}})";
const std::string kConfig =
    R"({"name":"rig","joints":[)" + kJoint +
    R"(],"tick_hz":80000,"queue_capacity":64,"state_hz":100,"sensor_hz":20,"hold_timeout_ms":400,"enable_lead_ms":200,)"
    R"("armed_at_boot":false,"enable_pin":12,"enable_inverted":true,)"
    R"("inputs":[{"name":"home_q1","pin":32,"role":"home","joint":0,"inverted":true,"pull":"up"},)"
    R"({"name":"seta","pin":21,"role":"estop"}],)"
    R"("outputs":[{"name":"lamp","pin":13,"inverted":true,"at_boot":true,"off_at_estop":true}],)"
    R"("sensors":[{"name":"ultra","kind":"ultrasonic","pin":35,"trigger_pin":4,"scale_q16":1124,"offset_milli":-500},)"
    R"({"name":"battery","kind":"analog","pin":34}],)"
    R"("servo":{"name":"jaws","pin":14,"lower_us":1000,"upper_us":2000,"speed_us_s":1500,"off_at_estop":true}})";

struct Parsed {
    bool is_taken;
    DeviceConfig config;
    std::string said;  // part: reason
};

Parsed parse(const std::string& text) {
    Parsed parsed{};
    Refusal refusal;
    parsed.is_taken = parse_config(text.data(), text.size(), &parsed.config, &refusal);
    parsed.said = std::string(refusal.part) + ": " + refusal.reason;
    return parsed;
}

// The whole configuration with one text replaced by another.
std::string with(const std::string& old, const std::string& fresh) {
    const size_t at = kConfig.find(old);
    EXPECT_NE(at, std::string::npos) << old;
    return std::string(kConfig).replace(at, old.size(), fresh);
}

std::string said_of(const std::string& old, const std::string& fresh) {
    const Parsed parsed = parse(with(old, fresh));
    EXPECT_FALSE(parsed.is_taken) << fresh;
    return parsed.said;
}

}  // namespace

TEST(Config, EveryFieldArrives) {
    const Parsed parsed = parse(kConfig);
    ASSERT_TRUE(parsed.is_taken) << parsed.said;
    const DeviceConfig& config = parsed.config;
    EXPECT_STREQ(config.name, "rig");
    EXPECT_EQ(config.tick_hz, 80000u);
    EXPECT_EQ(config.queue_capacity, 64u);
    EXPECT_EQ(config.state_hz, 100u);
    EXPECT_EQ(config.sensor_hz, 20u);
    EXPECT_EQ(config.hold_timeout_ms, 400u);
    EXPECT_EQ(config.enable_lead_ms, 200u);
    EXPECT_EQ(config.is_armed_at_boot, 0);
    EXPECT_EQ(config.enable_pin, 12);
    EXPECT_EQ(config.is_enable_inverted, 1);
    ASSERT_EQ(config.joints, 1);
    EXPECT_EQ(config.joint[0].text_scale_q32, 9000000000u);
    EXPECT_EQ(config.joint[0].homing.direction, -1);
    EXPECT_EQ(config.joint[0].homing.timeout_ms, 9000u);
    ASSERT_EQ(config.inputs, 2);
    EXPECT_EQ(config.input[0].pull, Pull::Up);
    EXPECT_EQ(config.input[1].role, InputRole::EStop);
    ASSERT_EQ(config.outputs, 1);
    EXPECT_EQ(config.output[0].is_off_at_estop, 1);
    ASSERT_EQ(config.sensors, 2);
    EXPECT_EQ(config.sensor[0].offset_milli, -500);
    EXPECT_EQ(config.sensor[1].scale_q16, 65536000);
    EXPECT_STREQ(config.servo.name, "jaws");
    EXPECT_EQ(config.servo.pin, 14);
    EXPECT_EQ(config.servo.lower_us, 1000u);
    EXPECT_EQ(config.servo.upper_us, 2000u);
    EXPECT_EQ(config.servo.speed_us_s, 1500u);
    EXPECT_EQ(config.servo.is_off_at_estop, 1);
}

TEST(Config, WhatIsMissingHasTheDefaultOfTheSchema) {
    const Parsed parsed = parse(
        R"( { "joints" : [ {"upper_q8":1,"lower_q8":0,"max_velocity_q8":1,"max_acceleration_q8":1,"name":"q1"} ] , "name" : "x" } )");
    ASSERT_TRUE(parsed.is_taken) << parsed.said;
    EXPECT_EQ(parsed.config.tick_hz, 50000u);
    EXPECT_EQ(parsed.config.is_armed_at_boot, 1);
    EXPECT_EQ(parsed.config.enable_pin, kNone);
    EXPECT_EQ(parsed.config.joint[0].step_pin, kNone);
    EXPECT_EQ(parsed.config.joint[0].homing.input, kNone);
    EXPECT_EQ(parsed.config.servo.pin, kNone);
}

TEST(Config, AnUnknownADoubleAndAMissingKeyAreNamed) {
    EXPECT_EQ(said_of("\"tick_hz\"", "\"tick\""), ": \"tick\" is not a key that is known here");
    EXPECT_EQ(said_of("\"upper_q8\":2000", "\"lower_q8\":2000"), "q1: \"lower_q8\" is there twice");
    EXPECT_EQ(said_of("\"upper_q8\":2000,", ""), "q1: \"upper_q8\" is missing");
    EXPECT_EQ(said_of("\"name\":\"q1\",", ""), "joints[0]: \"name\" is missing");
    EXPECT_EQ(said_of("\"timeout_ms\":9000", "\"timeout\":9000"), "q1: \"timeout\" is not a key that is known here");
    EXPECT_EQ(said_of("\"name\":\"rig\",", ""), ": \"name\" is missing");
}

TEST(Config, ANumberOutOfItsRangeIsRefusedWithTheRange) {
    EXPECT_EQ(said_of("-1000", "-2147483649"), "q1: \"lower_q8\" is not -2147483648 to 2147483647");
    EXPECT_EQ(said_of("\"step_pin\":1", "\"step_pin\":256"), "q1: \"step_pin\" is not 0 to 255");
    EXPECT_EQ(said_of("\"direction\":-1", "\"direction\":200"), "q1: \"direction\" is not -128 to 127");
    EXPECT_EQ(said_of("\"input\":0", "\"input\":255"), "q1: \"input\" is not 0 to 254");
    EXPECT_EQ(said_of("80000", "-1"), ": \"tick_hz\" is not 0 to 4294967295");
    EXPECT_EQ(said_of("80000", "8e4"), ": \"tick_hz\": an integer is expected (byte 370)");
    EXPECT_EQ(said_of("\"estop\"", "\"panic\""), "seta: \"role\" is none of estop, limit_lower, limit_upper, home");
    EXPECT_EQ(said_of("\"rig\"", "\"abcdefghijklmnopqrstuvwxyz0123456\""), ": \"name\" is longer than 31 bytes");
}

TEST(Config, BrokenJsonIsRefusedWithItsPlace) {
    EXPECT_EQ(parse("").said, ": an object is expected (byte 0)");
    EXPECT_EQ(parse("[]").said, ": an object is expected (byte 0)");
    EXPECT_EQ(parse("{\"name\":\"x\"").said, ": the text ends too early (byte 11)");
    EXPECT_EQ(parse(kConfig + "}").said, ": something follows the end (byte " + std::to_string(kConfig.size()) + ")");
    EXPECT_EQ(parse("{\"name\":nul}").said, ": \"name\": a text in quotes is expected (byte 8)");
    EXPECT_EQ(parse("{\"name\":\"x\",}").said, ": a text in quotes is expected (byte 12)");
}

TEST(Config, NoPrefixOfATextIsTakenOrHarmful) {
    for (size_t size = 0; size < kConfig.size(); ++size) EXPECT_FALSE(parse(kConfig.substr(0, size)).is_taken);
}

TEST(Config, ListsHaveAnEnd) {
    std::string joints = kJoint;
    for (int i = 0; i < kMaxJoints; ++i) joints += "," + kJoint;
    EXPECT_EQ(said_of(kJoint, joints), ": \"joints\" has more than 8 entries");
    const std::string deep(4000, '[');
    EXPECT_EQ(parse("{\"joints\":" + deep).said, "joints[0]: an object is expected (byte 11)");
    EXPECT_EQ(parse(std::string(kMaxConfigText + 1, ' ')).said, ": its text is longer than 8220 bytes");
}

TEST(Config, FaultsNameThePartAndTheReason) {
    const std::map<std::pair<std::string, std::string>, std::string> faults = {
        {{"\"rig\"", "\"r g\""}, ": its name is not 1 to 31 letters, digits, '_' or '-'"},
        {{"\"q1\"", "\"\""}, ": its name is not 1 to 31 letters, digits, '_' or '-'"},
        {{"-1000", "2000"}, "q1: its lower limit is not below its upper limit"},
        {{"512000", "0"}, "q1: its velocity limit is not positive"},
        {{"700", "-1"}, "q1: its acceleration limit is not positive"},
        {{"\"dir_setup_us\":5", "\"dir_setup_us\":201"}, "q1: its DIR set-up time is longer than 200 us"},
        {{"\"step_pin\":1", "\"step_pin\":64"}, "q1: its pin is not 0 to 63"},
        {{"\"step_pin\":1", "\"step_pin\":2"}, "q1: its pin is used by something else too"},
        {{"\"step_pin\":1,", ""}, "q1: it has only one of step_pin and dir_pin"},
        {{"9000000000", "9223372036854775808"}, "q1: its text_scale_q32 is over 2^63 - 1"},
        {{"\"input\":0", "\"input\":2"}, "q1: its homing names an input that is not there"},
        {{"\"input\":0", "\"input\":1"}, "q1: its homing names a switch that is not its own"},
        {{"\"direction\":-1", "\"direction\":0"}, "q1: its homing's direction is not 1 or -1"},
        {{"\"group\":3", "\"group\":16"}, "q1: its homing's group is not 0 to 15"},
        {{"\"slow_q8\":25", "\"slow_q8\":257"}, "q1: its homing is not slow and then fast: 0 < slow_q8 <= fast_q8"},
        {{"\"slow_q8\":25", "\"slow_q8\":0"}, "q1: its homing is not slow and then fast: 0 < slow_q8 <= fast_q8"},
        {{"\"fast_q8\":256", "\"fast_q8\":512001"}, "q1: its homing is faster than its velocity limit"},
        {{"\"back_off_q8\":100", "\"back_off_q8\":0"}, "q1: its homing's back_off_q8 is not positive"},
        {{"\"back_off_q8\":100", "\"back_off_q8\":49"}, "q1: its homing ends, after backing off, beyond its limits"},
        {{"\"max_travel_q8\":4000", "\"max_travel_q8\":-4"}, "q1: its homing's max_travel_q8 is not positive"},
        {{"\"timeout_ms\":9000", "\"timeout_ms\":0"}, "q1: its homing's timeout_ms is not 1 to 600000"},
        {{"\"role\":\"home\"", "\"role\":\"limit_upper\""}, "q1: its homing leads away from its limit switch"},
        {{"\"joint\":0", "\"joint\":1"}, "q1: its homing names a switch that is not its own"},
        {{"\"role\":\"estop\"", "\"role\":\"home\",\"joint\":1"}, "seta: its joint is not there"},
        {{"\"role\":\"estop\"", "\"role\":\"estop\",\"joint\":0"}, "seta: an e-stop belongs to all joints, not to one"},
        {{"\"role\":\"estop\"}", "\"role\":\"estop\"},{\"name\":\"b\",\"pin\":22,\"role\":\"estop\"}"},
         "b: it is a second e-stop: wire the buttons in series"},
        {{"\"seta\"", "\"home_q1\""}, "home_q1: its name is there twice"},
        {{"\"pin\":13", "\"pin\":21"}, "lamp: its pin is used by something else too"},
        {{"\"pin\":13", "\"pin\":255"}, "lamp: its pin is not 0 to 63"},
        {{"\"trigger_pin\":4,", ""}, "ultra: an ultrasonic sensor needs a trigger_pin"},
        {{"\"pin\":34", "\"pin\":34,\"trigger_pin\":5"}, "battery: an analog sensor has no trigger_pin"},
        {{"\"battery\"", "\"t_us\""}, "t_us: its name is taken by the readings' own message"},
        {{"80000", "80001"}, ": tick_hz is not a multiple of 1000 between 10000 and 100000"},
        {{"\"queue_capacity\":64", "\"queue_capacity\":129"}, ": queue_capacity is not 2 to 128 knots"},
        {{"\"state_hz\":100", "\"state_hz\":3"}, ": state_hz does not divide 1000"},
        {{"\"sensor_hz\":20", "\"sensor_hz\":0"}, ": sensor_hz does not divide 1000"},
        {{"\"hold_timeout_ms\":400", "\"hold_timeout_ms\":0"}, ": hold_timeout_ms is not 1 to 60000"},
        {{"\"enable_lead_ms\":200", "\"enable_lead_ms\":10001"}, ": enable_lead_ms is over 10000"},
        {{"\"enable_pin\":12", "\"enable_pin\":99"}, ": enable_pin is not 0 to 63"},
        {{"\"enable_pin\":12", "\"enable_pin\":21"}, "seta: its pin is used by something else too"},
        {{"[" + kJoint + "]", "[]"}, ": there are not 1 to 8 joints"},
        {{"\"lower_us\":1000", "\"lower_us\":499"}, "jaws: its pulses are not 500 to 2500 us"},
        {{"\"upper_us\":2000", "\"upper_us\":2501"}, "jaws: its pulses are not 500 to 2500 us"},
        {{"\"lower_us\":1000", "\"lower_us\":2000"}, "jaws: its lower_us is not below its upper_us"},
        {{"\"speed_us_s\":1500", "\"speed_us_s\":9"}, "jaws: its speed_us_s is not 10 to 1000000"},
        {{"\"pin\":14", "\"pin\":13"}, "jaws: its pin is used by something else too"},
        {{"\"jaws\"", "\"j ws\""}, "j ws: its name is not 1 to 31 letters, digits, '_' or '-'"},
    };
    for (const auto& [change, said] : faults) EXPECT_EQ(said_of(change.first, change.second), said) << change.second;
}
