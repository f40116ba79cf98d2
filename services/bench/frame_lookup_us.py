"""One look-up of the tool's pose in the base frame, at a time between two samples, in a full buffer."""

from __future__ import annotations

import math
import random
import time

from schemas.frames import FrameTransform
from services.arm.chain import joint_transform
from services.arm.description import Arm
from services.arm.frames import FrameBuffer
from services.arm.transforms import to_message
from services.bench.arms import rm1
from services.bench.figure import Figure, Goal, NotMeasured, of_samples, quantile

UNIT = "us"
GOAL = Goal(median=10.0)
SECOND = 1_000_000_000  # [ns]
RATE, SPAN = 50, 9  # [Hz], [s] of samples in the buffer
BATCH, BATCHES = 100, 300  # a batch is timed as one, or the clock itself would show


def measure() -> Figure:
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
    return of_samples(samples, UNIT, GOAL, reference, note)


def filled_buffer(arm: Arm) -> FrameBuffer:
    """All joints of `arm` on sines, `RATE` times a second over `SPAN` seconds."""
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


def yourdfpy_us(arm: Arm) -> float:
    """[us] median of setting the joints and asking for the tool."""
    try:
        import yourdfpy
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
