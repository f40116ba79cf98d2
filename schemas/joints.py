"""Joint states, streamed joint targets, and the step error of every joint."""

from __future__ import annotations

from gemelo.schemas.message import Message, Vector

MOST_AHEAD = 128  # targets of one message; chosen: beyond the chunks of today's policies, which are 50 to 100
LONGEST_AHEAD = 5.0  # [s] from a message's stamp to its last target; chosen: 100 actions of 20 Hz
LEAST_APART = 0.001  # [s] between two of them; chosen: far below a device's knots


class JointState(Message, frozen=True, kw_only=True):
    """Joints at one instant, as sensor_msgs/JointState: parallel tuples, possibly empty but `name`."""

    stamp: int = 0  # [ns] UNIX time of the measurement
    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]
    velocity: Vector = ()  # [rad/s] or [m/s]
    effort: Vector = ()  # [N m] or [N]; empty: steppers do not measure it
    commanded: bool = False  # true: what was sent, of a device that does not say what it has executed


class TargetAhead(Message, frozen=True, kw_only=True):
    """Where the joints of a target are to be later."""

    time: float = 0.0  # [s] after the target's stamp
    position: Vector = ()  # [rad] or [m]
    velocity: Vector = ()  # [rad/s] or [m/s]; empty: of the curve through the positions, and at rest at the last one


class JointTargets(Message, frozen=True, kw_only=True):
    """Streamed target positions of some or all joints, from a slider, a script or a policy; the newest one wins.

    With `ahead` it is a chunk, which is played; of the one before counts what is due by the stamp of the newest.
    """

    stamp: int = 0  # [ns] UNIX time of the sender
    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]
    client: str = ""  # the node whose jogging they are, where the planner writes them; empty: the writer's own
    velocity: Vector = ()  # [rad/s] or [m/s] there; empty: estimated from the targets; zeros: a place to rest at
    ahead: tuple[TargetAhead, ...] = ()  # by their times, at most `MOST_AHEAD`
    to_watch: bool = False  # the planner's own whose way nobody has looked at yet, as that of others; not a jog's


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
