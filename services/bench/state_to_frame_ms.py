"""From the device's state on the wire to the tool's frames at a client: gateway, bus, state_publisher, bus.

An MQTT client of our own hears each STATE frame when the gateway does; the gateway's `device/state` says which stamp it
gave to that device time, and `frames` bear the same stamp.
"""

from __future__ import annotations

import time

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from schemas.device import DeviceState
from schemas.frames import FrameTransforms
from schemas.topics import DEVICE_STATE, FRAMES
from services.bench.echo import send_at_once
from services.bench.figure import Figure, Goal, NotMeasured, of_samples
from services.bench.stacks import Running, Stacks
from services.stepper_gateway.links.frames import BadFrame, State, decode

UNIT = "ms"
GOAL = Goal(p99=5.0)
DURATION = 15.0  # [s]


def measure(stacks: Stacks) -> Figure:
    running = stacks.any_broker()
    arrivals: dict[int, float] = {}  # of STATE on the wire [s monotonic], by device time [us]
    device_times: dict[int, int] = {}  # [us] by stamp [ns]
    frames: dict[int, float] = {}  # [s monotonic] by stamp [ns]

    def on_device_state(message: DeviceState) -> None:
        device_times[message.stamp] = message.device_time

    def on_frames(message: FrameTransforms) -> None:
        if message.transforms:
            frames.setdefault(message.transforms[0].stamp, time.monotonic())

    running.node.subscribe(DEVICE_STATE, on_device_state)
    running.node.subscribe(FRAMES, on_frames)
    listener = listen(running, arrivals)
    running.node.wait(DURATION)
    listener.disconnect()
    listener.loop_stop()
    samples = [
        (when - arrivals[device_times[stamp]]) * 1e3
        for stamp, when in frames.items()
        if device_times.get(stamp) in arrivals
    ]
    if not samples:
        raise NotMeasured(f"{len(arrivals)} states, {len(frames)} frames, but none belong together")
    note = (
        f"{len(samples)} of {len(arrivals)} states of {DURATION:g} s (all these topics keep only the newest), "
        f"broker {running.deployment.mqtt.broker}"
    )
    return of_samples(samples, UNIT, GOAL, note=note)


def listen(running: Running, arrivals: dict[int, float]) -> Client:
    """Notes when each STATE frame comes over MQTT."""

    def on_message(client: Client, userdata: object, message: MQTTMessage) -> None:
        now = time.monotonic()
        try:
            frame = decode(bytes(message.payload))
        except BadFrame:
            return
        if isinstance(frame, State):
            arrivals[frame.t_us] = now

    client = Client(CallbackAPIVersion.VERSION2, client_id=f"bench-state-{time.time_ns()}")
    client.on_socket_open = send_at_once
    client.on_connect = lambda c, userdata, flags, code, properties: c.subscribe(
        f"gemelo/v1/{running.arm.device.name}/state", qos=0
    )
    client.on_message = on_message
    client.connect(running.deployment.mqtt.host, running.deployment.mqtt.port)
    client.loop_start()
    return client
