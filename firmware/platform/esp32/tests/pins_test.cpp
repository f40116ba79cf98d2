// The pins over several configurations: what one has used, the next finds as it needs it.
#include "pins.h"

#include <gtest/gtest.h>

#include "config.h"
#include "fake_idf.h"
#include "pin_map.h"
#include "sensors.h"
#include "this_chip.h"
#include "voltmeter.h"

using namespace gemelo;
using fake::chip;

namespace {

constexpr uint8_t kBattery = 33, kBoot = 0;

DeviceConfig nothing() {
    DeviceConfig config{};
    config.joints = 1;
    for (JointConfig& joint : config.joint) joint.step_pin = joint.dir_pin = kNone;
    config.enable_pin = kNone;
    return config;
}

DeviceConfig with_battery() {
    DeviceConfig config = nothing();
    config.sensors = 1;
    config.sensor[0].kind = SensorKind::Analog;
    config.sensor[0].pin = kBattery;
    config.sensor[0].trigger_pin = kNone;
    return config;
}

DeviceConfig with_input(uint8_t pin) {
    DeviceConfig config = nothing();
    config.inputs = 1;
    config.input[0].pin = pin;
    config.input[0].pull = Pull::Up;
    return config;
}

int32_t measured(Voltmeter& voltmeter) {
    int32_t millivolts = -1;
    EXPECT_TRUE(voltmeter.measure(kBattery, &millivolts));
    return millivolts;
}

class Esp32Pins : public testing::Test {
  protected:
    void SetUp() override {
        fake::reset();
        voltmeter.begin();
    }
    void configure(const DeviceConfig& config) {
        config_ = config;
        pins_.set_up(config_);
        set_sensors(config_);
    }
    Voltmeter voltmeter;

  private:
    DeviceConfig config_;
    SlowPins pins_;
};

}  // namespace

TEST_F(Esp32Pins, AnAnalogPinReadsTheSameAfterASecondConfiguration) {
    configure(with_battery());
    EXPECT_EQ(measured(voltmeter), fake::kAnalogMv);
    configure(with_battery());
    EXPECT_EQ(measured(voltmeter), fake::kAnalogMv);
}

TEST_F(Esp32Pins, AnAnalogPinThatWasAnInputInBetweenIsAtTheAdcAgain) {
    configure(with_battery());
    EXPECT_EQ(measured(voltmeter), fake::kAnalogMv);
    configure(with_input(kBattery));
    EXPECT_EQ(chip.is_input >> kBattery & 1, 1u);
    configure(with_battery());
    EXPECT_EQ(measured(voltmeter), fake::kAnalogMv);
}

TEST_F(Esp32Pins, AnAnalogPinIsNotEvenLetGoBetweenTwoConfigurations) {
    configure(with_battery());
    measured(voltmeter);
    configure(with_battery());
    EXPECT_EQ(chip.is_analog >> kBattery & 1, 1u);
}

TEST_F(Esp32Pins, TheBootButtonCanBeReadAfterAConfigurationThatUsedItsPin) {
    ASSERT_EQ(kThisChip.boot_button, kBoot);
    configure(nothing());
    EXPECT_EQ(chip.is_input >> kBoot & 1, 1u);
    configure(with_input(kBoot));
    configure(nothing());
    // Let go, it would read low, which is pressed: a factory reset after 5 s.
    EXPECT_EQ(chip.is_input >> kBoot & 1, 1u);
}
