"""Figures of frames: a look-up in a full buffer, and the latency from device state to frames on a stack."""

from __future__ import annotations

import math
import random
import time

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.arm.frames.frame_buffer import FrameBuffer
from gemelo.libraries.arm.frames.transforms import to_message
from gemelo.libraries.arm.kinematics.chain import joint_transform
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.mqtt.client import stop_loop
from gemelo.schemas.device import DeviceState
from gemelo.schemas.frames import FrameTransform, FrameTransforms
from gemelo.schemas.topics import DEVICE_STATE, FRAMES
from gemelo.services.stepper_gateway.links.frames import BadFrame, StateFrame, decode
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.bench.stack import Running, Stacks
from gemelo.tools.bench.traffic import send_at_once

LOOKUP_GOAL = FigureGoal(median=10.0)  # [us]
SECOND = 1_000_000_000  # [ns]
RATE, SPAN = 50, 9  # [Hz], [s] of samples in the buffer
BATCH, BATCHES = 100, 300  # a batch is timed as one: reading the clock takes long


def frame_lookup_us() -> Figure:
    """Time [us] of one look-up of the tool in the base frame, between two samples of a full buffer."""
    arm = rm1()
    buffer = filled_buffer(arm)
    random_ = random.Random(1)
    samples = []
    for _ in range(BATCHES):
        stamps = [random_.randrange(SECOND, SPAN * SECOND) for _ in range(BATCH)]
        started = time.perf_counter()
        for stamp in stamps:
            buffer.look_up(arm.base_frame, arm.tool_frame, stamp)
        samples.append((time.perf_counter() - started) / BATCH * 1e6)
    reference = {"yourdfpy forward kinematics": yourdfpy_us(arm)}
    note = f"{len(arm.joints)} moving joints, {RATE * SPAN} samples each, a random time; batches of {BATCH}"
    return of_samples(samples, LOOKUP_GOAL, reference, note)


def filled_buffer(arm: ArmDescription) -> FrameBuffer:
    """A buffer of all joints of `arm` on sines, `RATE` [Hz] over `SPAN` [s]."""
    buffer = FrameBuffer()
    for joint in arm.model.joints:
        for beat in range(RATE * SPAN + 1):
            position = 0.5 * math.sin(beat / RATE)
            transform = to_message(joint_transform(joint, position))
            frame = FrameTransform(
                stamp=SECOND + beat * SECOND // RATE, parent=joint.parent, child=joint.child, transform=transform
            )
            buffer.insert(frame)
    return buffer


def yourdfpy_us(arm: ArmDescription) -> float:
    """Median time [us] of yourdfpy's forward kinematics to the tool; raises NotMeasured if it is not installed."""
    try:
        import yourdfpy  # slow to load
    except ImportError as error:
        raise NotMeasured(f"the reference needs yourdfpy (extra `view`): {error}") from error
    robot = yourdfpy.URDF.load(str(arm.urdf_path), build_scene_graph=True, load_meshes=False)
    samples = []
    for index in range(300):
        values = [0.5 * math.sin(index + column) for column in range(len(robot.actuated_joints))]
        started = time.perf_counter()
        robot.update_cfg(values)
        robot.get_transform(arm.tool_frame, arm.base_frame)
        samples.append((time.perf_counter() - started) * 1e6)
    return quantile(samples, 0.5)


LATENCY_GOAL = FigureGoal(p99=5.0)  # [ms]
DURATION = 15.0  # [s]


def state_to_frame_ms(stacks: Stacks) -> Figure:
    """Time [ms] from the device's state on the wire to the frames at a client, through gateway and publisher.

    An MQTT client of the bench receives each STATE frame when the gateway does; `device/state` has the stamp that the
    gateway gave to that device time, and `frames` have the same stamp.
    """
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
    stop_loop(listener)
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
    return of_samples(samples, LATENCY_GOAL, note=note)


def listen(running: Running, arrivals: dict[int, float]) -> Client:
    """Puts the arrival time [s monotonic] of each STATE frame into `arrivals`, by device time [us]."""

    def on_message(client: Client, userdata: object, message: MQTTMessage) -> None:
        now = time.monotonic()
        try:
            frame = decode(bytes(message.payload))
        except BadFrame:
            return
        if isinstance(frame, StateFrame):
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
