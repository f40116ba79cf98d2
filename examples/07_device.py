"""Asks the controller board how it is, and reads what is connected to it; a virtual one can be given a fault."""

import gemelo

with gemelo.connect() as arm:
    device = arm.device
    print(f"{device.status.device}: {device.mode.name}, firmware {device.status.firmware}")
    print("switches:", arm.inputs, "outputs:", arm.outputs, "sensors:", arm.sensors)
    if device.status.virtual:
        where = arm.joints
        device.inject("estop")
        print(device.fault)
        device.inject("estop", value=0)
        device.reset()
        device.arm()
        arm.reference(where)  # an emergency stop takes the current from the motors, and so the reference
    print(device.mode.name)
