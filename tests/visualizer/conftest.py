"""A synthetic arm that moves, so that the view can be judged without the stack."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from gemelo.schemas.device import DeviceEvent, DeviceMode, DeviceState, DeviceStatus, ShaftPositions
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.system import LogLevel, LogRecord
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.model.urdf import parse_urdf
from gemelo.services.visualizer.render.layout import ArmLayout, blueprint
from gemelo.services.visualizer.render.sink import APPLICATION, Sink

START = 1_795_000_000_000_000_000
NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")
STEPS_PER_UNIT = (18662.4 / math.tau, 400 / math.tau, 400 / math.tau / 0.0225)

URDF = """
<robot name="test">
  <material name="orange"><color rgba="0.95 0.45 0.2 1"/></material>
  <link name="base_link">
    <visual><origin xyz="0 0 0.02"/><geometry><cylinder radius="0.09" length="0.04"/></geometry></visual>
  </link>
  <link name="brazo_link">
    <visual><origin xyz="0.1 0 0.1"/><geometry><box size="0.25 0.07 0.06"/></geometry><material name="orange"/></visual>
  </link>
  <link name="antebrazo_link">
    <visual><origin xyz="0.1 0 0.05"/><geometry><box size="0.252 0.077 0.064"/></geometry></visual>
  </link>
  <link name="efector_link">
    <visual><geometry><cylinder radius="0.012" length="0.19"/></geometry></visual>
    <visual><origin xyz="0 0 0.1"/><geometry><sphere radius="0.016"/></geometry></visual>
  </link>
  <joint name="brazo_joint" type="revolute">
    <parent link="base_link"/><child link="brazo_link"/><axis xyz="0 0 1"/>
    <limit lower="-2.95" upper="2.95" velocity="1.57" effort="10"/>
  </joint>
  <joint name="antebrazo_joint" type="revolute">
    <origin xyz="0.20188 -0.00037 0.15187"/>
    <parent link="brazo_link"/><child link="antebrazo_link"/><axis xyz="0 0 1"/>
    <limit lower="-2.95" upper="2.95" velocity="1.57" effort="10"/>
  </joint>
  <joint name="efector_joint" type="prismatic">
    <origin xyz="0.20445 0.001 0.03418" rpy="3.1416 0 0"/>
    <parent link="antebrazo_link"/><child link="efector_link"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.1" velocity="0.1" effort="10"/>
  </joint>
</robot>
"""


def path_at(seconds: float) -> tuple[float, float, float]:
    """A motion with rests: rad, rad, m."""
    move = 0.5 - 0.5 * math.cos(math.pi * min(max((seconds % 6.0) / 4.0, 0.0), 1.0))
    forth = move if int(seconds // 6.0) % 2 == 0 else 1.0 - move
    return 1.4 * forth - 0.4, -1.0 * forth + 0.3, 0.04 * forth


def feed(core: Visualizer, index: int) -> int:
    """The messages of sample `index` at 50 Hz; returns their stamp."""
    stamp, desired = START + index * 20_000_000, path_at(index * 0.02)
    exact = tuple(value * scale for value, scale in zip(desired, STEPS_PER_UNIT, strict=True))
    steps = tuple(math.floor(value + 0.5) for value in exact)
    done = tuple(count / scale for count, scale in zip(steps, STEPS_PER_UNIT, strict=True))
    errors = tuple(value - count for value, count in zip(exact, steps, strict=True))
    is_moving = (index * 0.02) % 6.0 < 4.0
    core.on_joint_state(JointState(stamp=stamp, name=NAMES, position=done))
    core.on_joint_command(JointState(stamp=stamp, name=NAMES, position=desired))
    core.on_step_errors(
        StepErrors(stamp=stamp, name=NAMES, commanded=exact, executed=steps, error=errors, max_error=(0.5, 0.5, 0.5))
    )
    core.on_device_state(
        DeviceState(stamp=stamp, mode=DeviceMode.RUN if is_moving else DeviceMode.IDLE, name=NAMES, steps=steps,
                    time_scale=1.0 if is_moving else 0.0, buffered=0.4 if is_moving else 0.0, round_trip=0.0011)
    )  # fmt: skip
    core.on_shaft(ShaftPositions(stamp=stamp, name=NAMES, steps=steps, shaft=steps))
    return stamp


def tell_of_a_move(core: Visualizer, second: int) -> None:
    """The plan and the log of a move that begins now."""
    stamp = START + second * 1_000_000_000
    rows = np.array([path_at(second + 4.0 * k / 40) for k in range(41)])
    points = core.model.link_positions("efector_link", rows, list(NAMES))
    core.on_planned_path(PlannedPath(stamp=stamp, frame="base_link", points=tuple(map(tuple, points.tolist()))))
    core.event_log.on_log(
        LogRecord(stamp=stamp, node="planner", text=f"planned {second // 6 + 1} in 1.4 ms, takes 4.00 s")
    )
    core.event_log.on_event(DeviceEvent(stamp=stamp, device="rm1", event="started"))
    core.event_log.on_log(
        LogRecord(stamp=stamp + 4 * 10**9, node="stepper_gateway", level=LogLevel.WARNING, text="a warning")
    )


def synthetic(core: Visualizer, sink: Sink, seconds: float) -> None:
    """Drive core and sink as the service does, 10 batches a second, faster than real time."""
    status = DeviceStatus(stamp=START, online=True, device="rm1", firmware="1.0.0", boot_id=1, joints=3)
    core.on_device_status(status)
    for batch in range(int(seconds * 10)):
        if batch % 60 == 0:
            tell_of_a_move(core, batch // 10)
        for index in range(batch * 5, batch * 5 + 5):
            now = feed(core, index)
        sink.write(core.step(now))


@pytest.fixture(scope="session")
def model():
    return parse_urdf(URDF)


@pytest.fixture
def urdf_text() -> str:
    """The text that `model` was read from."""
    return URDF


@pytest.fixture
def core(model):
    return Visualizer(model, "rm1", "efector_link")


@pytest.fixture(scope="session")
def recording(tmp_path_factory, model) -> Path:
    """A recording of 22 s of motion."""
    path = tmp_path_factory.mktemp("rerun") / "synthetic.rrd"
    stream = rr.RecordingStream(APPLICATION, recording_id="synthetic")
    stream.save(str(path))
    core = Visualizer(model, "rm1", "efector_link")
    sink = Sink(stream, model, path.parent, blueprint(ArmLayout(model, 20.0, 20.0)))
    synthetic(core, sink, 22.0)
    sink.close()
    return path
