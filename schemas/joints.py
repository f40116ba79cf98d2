"""Joint states, streamed joint targets, and the step error of every joint."""

from __future__ import annotations

from gemelo.schemas.message import Message, Vector


class JointState(Message, frozen=True, kw_only=True):
    """Joints at one instant, as sensor_msgs/JointState: parallel tuples, possibly empty but `name`."""

    stamp: int = 0  # [ns] UNIX time of the measurement
    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]
    velocity: Vector = ()  # [rad/s] or [m/s]
    effort: Vector = ()  # [N m] or [N]; empty: steppers do not measure it
    commanded: bool = False  # true: what was sent, of a device that does not say what it has executed


class JointTargets(Message, frozen=True, kw_only=True):
    """Streamed target positions of some or all joints, from a slider or script; the newest one wins."""

    stamp: int = 0  # [ns] UNIX time of the sender
    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]
    client: str = ""  # the node whose jogging they are, where the planner writes them; empty: the writer's own
    velocity: Vector = ()  # [rad/s] or [m/s] there; empty: estimated from the targets; zeros: a place to rest at


class StepErrors(Message, frozen=True, kw_only=True):
    """Commanded minus executed motor steps of every joint at one instant of the device's path.

    Both sides belong to the same moment of the trajectory, so that neither the network's delay
    nor a clock shows up in `error`. Rounding to whole steps alone gives +-0.5.
    """

    stamp: int = 0  # [ns] UNIX time of the measurement
    name: tuple[str, ...] = ()
    commanded: Vector = ()  # [steps] with a fraction: what the path asks for
    executed: tuple[int, ...] = ()  # [steps] what the device has emitted
    error: Vector = ()  # [steps] commanded - executed
    max_error: Vector = ()  # [steps] the largest |error| since the present motion began
