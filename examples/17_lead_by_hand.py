"""Leads the tool by a SpaceMouse or a game pad, whose axes are the tool's velocity, until the device is pulled out.

python examples/17_lead_by_hand.py /dev/input/by-id/... 0 350       a SpaceMouse: axes of -350 to 350
python examples/17_lead_by_hand.py /dev/input/by-id/... 0 32768     a game pad; some have 128 128: 0 to 255
"""

import struct
import sys
import threading
import time

import gemelo

EVENT = struct.Struct("llHHi")  # an event of evdev, linux/input.h: seconds, microseconds, type, code and value
RELATIVE, ABSOLUTE = 2, 3  # types of events of axes: a SpaceMouse has one or the other, by its model
SPEED, RATE, DEAD = 0.05, 50.0, 0.1  # [m/s] at full deflection, [Hz], share of an axis that is rest
path, centre, full = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
axes = {0: 0.0, 1: 0.0, 2: 0.0}


def read() -> None:
    with open(path, "rb", buffering=0) as device:
        while len(event := device.read(EVENT.size)) == EVENT.size:
            _, _, kind, code, value = EVENT.unpack(event)
            if kind in (RELATIVE, ABSOLUTE) and code in axes:
                axes[code] = (value - centre) / full if abs(value - centre) > DEAD * full else 0.0


with gemelo.connect() as arm:
    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    pose = arm.pose()
    while reader.is_alive():
        moved = pose.offset(*(SPEED / RATE * part for part in (axes[0], -axes[1], -axes[2])))
        try:
            arm.stream(pose=moved)
            pose = moved
        except gemelo.Refused as refused:
            print(refused)
        time.sleep(1 / RATE)
    print("the tool is at", *(f"{part:.3f}" for part in arm.pose().position), "m")
