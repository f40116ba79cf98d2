// The world of a virtual device, and a motor alone, as plain C functions for ctypes.
#include "../platform/host/virtual_device.h"

using gemelo::HornConfig;
using gemelo::Motor;
using gemelo::MotorConfig;
using gemelo::VirtualDevice;

extern "C" {

// Counts from gemelo_start() on.
void gemelo_set_motor(VirtualDevice* device, uint8_t joint, const MotorConfig* motor) {
    device->world().set_motor(joint, *motor);
}

void gemelo_set_horn(VirtualDevice* device, const HornConfig* horn) { device->world().set_horn(*horn); }

void gemelo_put_object(VirtualDevice* device, double stop_us) { device->world().horn().put_object(stop_us); }

void gemelo_take_object(VirtualDevice* device) { device->world().horn().take_object(); }

void gemelo_inherit(VirtualDevice* device, const VirtualDevice* before) { device->world().inherit(before->world()); }

// 0: left to the arm, 1: held, 2: held open.
void gemelo_press(VirtualDevice* device, uint8_t input, uint8_t press) {
    device->world().press(input, static_cast<gemelo::Press>(press));
}

void gemelo_block(VirtualDevice* device, uint8_t joint, int blocked) { device->world().block(joint, blocked != 0); }

void gemelo_slip(VirtualDevice* device, uint8_t joint, int32_t pulses) { device->world().slip(joint, pulses); }

void gemelo_set_sensor(VirtualDevice* device, uint8_t sensor, double value) { device->set_sensor(sensor, value); }

void gemelo_freeze(VirtualDevice* device, uint64_t duration_us) { device->freeze(duration_us); }

Motor* gemelo_motor_create(const MotorConfig* config, double tick_s) {
    Motor* motor = new Motor;
    motor->begin(*config, tick_s, 0);
    return motor;
}

void gemelo_motor_destroy(Motor* motor) { delete motor; }

void gemelo_motor_pulse(Motor* motor, int direction) { motor->pulse(direction); }

void gemelo_motor_run(Motor* motor, uint64_t ticks) {
    for (uint64_t i = 0; i < ticks && !motor->is_settled(); ++i) motor->tick();
}

void gemelo_motor_hold(Motor* motor, int held) { motor->hold(held != 0); }

int32_t gemelo_motor_shaft(const Motor* motor) { return motor->shaft(); }

}  // extern "C"
