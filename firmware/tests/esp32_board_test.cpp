// Configurations that each chip can serve, and the tables that turn joints into GPIO bits.
#include <gtest/gtest.h>

#include <cstring>

#include "board_check.h"
#include "pin_map.h"
#include "pin_uses.h"

using namespace gemelo;

namespace {

// rm1's wiring on a DevKitC, as firmware/README.md shows it.
DeviceConfig wired() {
    DeviceConfig config{};
    config.tick_hz = 50000;
    config.joints = 3;
    const uint8_t pins[3][2] = {{25, 27}, {18, 19}, {22, 23}};
    const char* names[3] = {"q1", "q2", "q3"};
    for (uint8_t j = 0; j < 3; ++j) {
        std::strcpy(config.joint[j].name, names[j]);
        config.joint[j].step_pin = pins[j][0];
        config.joint[j].dir_pin = pins[j][1];
    }
    config.enable_pin = 13;
    config.inputs = 2;
    std::strcpy(config.input[0].name, "estop");
    config.input[0].pin = 21;
    config.input[0].pull = Pull::Up;
    std::strcpy(config.input[1].name, "home_q1");
    config.input[1].pin = 32;
    config.outputs = 1;
    std::strcpy(config.output[0].name, "avanzar");
    config.output[0].pin = 2;
    config.sensors = 2;
    std::strcpy(config.sensor[0].name, "bateria");
    config.sensor[0].kind = SensorKind::Analog;
    config.sensor[0].pin = 34;
    std::strcpy(config.sensor[1].name, "ultra");
    config.sensor[1].kind = SensorKind::Ultrasonic;
    config.sensor[1].pin = 35;
    config.sensor[1].trigger_pin = 4;
    return config;
}

std::string fault(const DeviceConfig& config, const Chip& chip = kEsp32) {
    const ConfigFault found = find_board_fault(config, chip);
    return found.sentence == nullptr ? "" : std::string(found.part) + ": " + found.sentence;
}

}  // namespace

TEST(BoardCheck, TakesTheWiringOfRm1) { EXPECT_EQ(fault(wired()), ""); }

TEST(BoardCheck, SeesEveryPinOfTheWiring) {
    const DeviceConfig config = wired();
    const PinUses uses(config);
    EXPECT_EQ(uses.end() - uses.begin(), 13);
}

TEST(BoardCheck, FillsNoMoreThanItsListWithTheLargestConfiguration) {
    DeviceConfig config{};
    config.joints = kMaxJoints;
    config.inputs = kMaxInputs;
    config.outputs = kMaxOutputs;
    config.sensors = kMaxSensors;
    config.enable_pin = 0;
    for (JointConfig& joint : config.joint) joint.step_pin = joint.dir_pin = 0;
    for (InputConfig& input : config.input) input.pin = 0;
    for (OutputConfig& output : config.output) output.pin = 0;
    for (SensorConfig& sensor : config.sensor) {
        sensor.kind = SensorKind::Ultrasonic;
        sensor.pin = sensor.trigger_pin = 0;
    }
    const PinUses uses(config);
    EXPECT_EQ(uses.end() - uses.begin(), 2 * kMaxJoints + kMaxInputs + kMaxOutputs + 2 * kMaxSensors + 1);
}

TEST(BoardCheck, RefusesAStepPinThatCanOnlyBeAnInput) {
    DeviceConfig config = wired();
    config.joint[1].step_pin = 36;
    EXPECT_EQ(fault(config), "q2: its pin can only be an input");
}

TEST(BoardCheck, RefusesAPullResistorThatIsNotThere) {
    DeviceConfig config = wired();
    config.input[0].pin = 39;
    EXPECT_EQ(fault(config), "estop: its pin has no pull resistor: fit one and say pull none");
    config.input[0].pull = Pull::None;
    EXPECT_EQ(fault(config), "");
}

TEST(BoardCheck, RefusesThePinsOfTheFlashAndOfTheSerialWire) {
    for (uint8_t pin = 6; pin <= 11; ++pin) {
        DeviceConfig config = wired();
        config.output[0].pin = pin;
        EXPECT_EQ(fault(config), "avanzar: its pin belongs to the flash memory");
    }
    DeviceConfig config = wired();
    config.output[0].pin = 1;
    EXPECT_EQ(fault(config), "avanzar: its pin belongs to the serial wire");
}

TEST(BoardCheck, AWireOverTheChipsUsbTakesItsPinsAndFreesThoseOfTheUart) {
    struct Board {
        const Chip &uart, &usb;
        uint8_t minus, plus;
    };
    for (const Board& board : {Board{kEsp32S3, kEsp32S3Usb, 19, 20}, Board{kEsp32C3, kEsp32C3Usb, 18, 19}}) {
        DeviceConfig config{};
        config.tick_hz = 50000;
        config.outputs = 1;
        std::strcpy(config.output[0].name, "avanzar");
        config.enable_pin = kNone;
        config.servo.pin = kNone;
        const auto with = [&](uint8_t pin, const Chip& chip) {
            config.output[0].pin = pin;
            return fault(config, chip);
        };
        for (const uint8_t pin : {board.minus, board.plus}) {
            EXPECT_EQ(with(pin, board.usb), "avanzar: its pin belongs to the serial wire");
            EXPECT_EQ(with(pin, board.uart), "");
        }
        for (const uint8_t pin : {board.uart.wire_tx, board.uart.wire_rx}) {
            EXPECT_EQ(with(pin, board.usb), "");
            EXPECT_EQ(with(pin, board.uart), "avanzar: its pin belongs to the serial wire");
        }
    }
}

TEST(BoardCheck, RefusesAPinThatTheChipDoesNotHave) {
    for (const int pin : {20, 24, 28, 40, 63, 64, 200}) {
        DeviceConfig config = wired();
        config.joint[2].dir_pin = static_cast<uint8_t>(pin);
        EXPECT_EQ(fault(config), "q3: this chip has no such pin") << pin;
    }
}

TEST(BoardCheck, RefusesAnAnalogSensorThatWifiWouldBlind) {
    DeviceConfig config = wired();
    config.sensor[0].pin = 14;  // ADC2
    EXPECT_EQ(fault(config), "bateria: its pin is not one of ADC1");
}

TEST(BoardCheck, RefusesAJointWithoutPins) {
    DeviceConfig config = wired();
    config.joint[0].dir_pin = kNone;
    EXPECT_EQ(fault(config), "q1: it has no step_pin or no dir_pin");
}

TEST(BoardCheck, RefusesATickThatTheTimerCannotMake) {
    DeviceConfig config = wired();
    config.tick_hz = 60000;
    EXPECT_EQ(fault(config), ": tick_hz does not divide the timer's 40 MHz");
    for (const uint32_t tick_hz : {10000u, 20000u, 40000u, 50000u, 80000u, 100000u}) {
        config.tick_hz = tick_hz;
        EXPECT_EQ(fault(config), "") << tick_hz;
    }
}

TEST(BoardCheck, KnowsThatOtherChipsHaveOtherPins) {
    EXPECT_EQ(fault(wired(), kEsp32S3), "q1: this chip has no such pin");  // 25
    EXPECT_EQ(fault(wired(), kEsp32C3), "q1: this chip has no such pin");
    DeviceConfig config = wired();
    config.joints = config.inputs = config.outputs = 1;
    config.sensors = 0;
    config.joint[0].step_pin = 4;
    config.joint[0].dir_pin = 5;
    config.enable_pin = 6;
    config.input[0].pin = 7;
    config.output[0].pin = 10;
    EXPECT_EQ(fault(config, kEsp32C3), "");
    EXPECT_EQ(fault(config, kEsp32S3), "");
    config.output[0].pin = 28;
    EXPECT_EQ(fault(config, kEsp32S3), "avanzar: its pin belongs to the flash memory");
}

TEST(BoardCheck, WarnsOfPinsThatAreReadAtReset) {
    const DeviceConfig config = wired();
    uint8_t from = 0;
    const ConfigFault first = next_board_warning(config, kEsp32, &from);
    ASSERT_NE(first.sentence, nullptr);
    EXPECT_STREQ(first.part, "avanzar");  // GPIO 2
    EXPECT_EQ(next_board_warning(config, kEsp32, &from).sentence, nullptr);
}

TEST(PinTable, GivesTheBitsOfAllJointsThatAreSetInBothBanks) {
    uint8_t pins[kMaxJoints];
    for (uint8_t j = 0; j < kMaxJoints; ++j) pins[j] = static_cast<uint8_t>(5 * j + 1);  // 1 to 36
    PinTable table;
    table.begin(pins);
    for (uint32_t joints = 0; joints < 1u << kMaxJoints; ++joints) {
        uint64_t expected = 0;
        for (uint8_t j = 0; j < kMaxJoints; ++j)
            if (joints >> j & 1) expected |= 1ull << pins[j];
        const uint64_t found = static_cast<uint64_t>(table[joints].high) << 32 | table[joints].low;
        ASSERT_EQ(found, expected) << joints;
    }
}

TEST(PinTable, LeavesOutJointsWithoutAPin) {
    uint8_t pins[kMaxJoints];
    std::memset(pins, kNone, sizeof pins);
    pins[1] = 31;
    pins[2] = 32;
    PinTable table;
    table.begin(pins);
    EXPECT_EQ(table[~0u].low, 1u << 31);
    EXPECT_EQ(table[~0u].high, 1u);
    EXPECT_EQ(table[1].low | table[1].high, 0u);
}
