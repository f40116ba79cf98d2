"""Moving by hand: jog commands, which stop by themselves when nothing more is said."""

from __future__ import annotations

import math
from collections.abc import Callable

from msgspec.structs import replace

from gemelo.api.arguments import Joints, Vector
from gemelo.api.errors import BadArgument, Interrupted, Lost, Refused
from gemelo.api.session import Session
from gemelo.api.targets import named_joints, vector
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planning import JogCommand, JogStatus
from gemelo.schemas.reasons import Reason, Remedy, because, plain, remedy
from gemelo.schemas.topics import JOG, JOG_STATUS

PERIOD = 0.02  # [s] between two jog commands; the planner's dead-man is 0.1 s
ANSWER = 3.0  # [s] of jogging without a word of the planner, after which it counts as lost
BEGIN = 0.5  # [s] of a jog in which a refusal may be about the past: the planner hears a goal's end after its client
PAUSE = 0.5  # [s] without a command, after which the next one begins a new jog
GAP = 1.0  # [s] without a word in the middle: the planner says ten a second
REST = 5.0  # [s] that the arm may take to come to rest
FASTEST = 1.0  # [m/s] of the tool of a desktop arm
FASTEST_TURN = math.pi  # [rad/s] of its tool


class JogCommands:
    """One connection's commands, and what the planner says to them."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._began = self._said = -math.inf  # [s] monotonic, of this jog's first and last command
        self._heard: JogStatus | None = None  # the newest that is about this node, or about the arm
        self._heard_at = -math.inf  # [s] monotonic

    def say(self, command: JogCommand) -> JogStatus | None:
        """Moves for 0.1 s; the planner's newest word on this jog. Raises `Refused`, or `Lost` where it says no more."""
        now = self._session.clock.monotonic()
        self._session.latest(JOG_STATUS, self._on_status)
        if now - self._said > PAUSE:
            self._began = now
        self._said = now
        node = self._session.node
        node.publisher(JOG).put(replace(command, stamp=node.now()))
        heard = self._heard_since(self._began)
        if heard is None and now - self._began > ANSWER:
            raise Lost(_silent())
        if heard is not None and now - self._heard_at > GAP:
            raise Lost(because("lost.jog.silent", remedy("list_nodes"), time=GAP))
        if heard is not None and not heard.active and heard.limited_by:
            counts_after = PERIOD if heard.check else BEGIN
            if now - self._began > counts_after:
                raise _refused(heard)
        return heard

    def hold(
        self, command: JogCommand, duration: float, on_progress: Callable[[JogStatus], object] | None
    ) -> JogStatus:
        """Says it for `duration` [s], then waits until the arm rests; raises `Interrupted` at Ctrl-C, when it rests."""
        end = self._session.clock.monotonic() + duration
        try:
            while self._session.clock.monotonic() < end:
                status = self.say(command)
                if status is not None and on_progress is not None:
                    on_progress(status)
                self._session.wait_for(lambda: False, min(PERIOD, max(0.0, end - self._session.clock.monotonic())))
        except KeyboardInterrupt:
            self.rest()
            raise Interrupted(because("client.jog.interrupted")) from None
        return self.rest()

    def end(self) -> JogStatus | None:
        """As `rest`; None if nothing was said in this jog."""
        return None if self._said == -math.inf else self.rest()

    def rest(self) -> JogStatus:
        """Waits until the planner leads no more; its last word."""
        began = self._began

        def is_at_rest() -> bool:
            status = self._heard_since(began)
            return status is not None and not status.active

        if not self._session.wait_for(is_at_rest, REST) or self._heard is None:
            is_silent = self._heard_since(began) is None
            raise Lost(_silent() if is_silent else because("lost.jog.end", time=REST))
        self._session.changed()
        if self._heard.limited_by and not self._heard.limits:
            raise _refused(self._heard)
        return self._heard

    def _on_status(self, status: JogStatus) -> None:
        if status.client in ("", self._session.node.address):
            self._heard, self._heard_at = status, self._session.clock.monotonic()

    def _heard_since(self, began: float) -> JogStatus | None:
        """The newest status, if it came after `began` [s] monotonic."""
        return self._heard if self._heard_at > began else None


def _silent() -> Reason:
    return because("lost.jog.planner", remedy("list_nodes"))


def _refused(status: JogStatus) -> Refused:
    why = status.why or plain(status.limited_by)
    return Refused(because("refused.plan", why), check=status.check or "jog", reason=why)


def jog_command(arm: ArmDescription, joints: Joints | None, twist: Vector | None, frame: str) -> JogCommand:
    """The command; raises `BadArgument` for what cannot be meant.

    `joints`: speeds [rad/s] or [m/s]; `twist`: (3,) [m/s] or (6,) [m/s] and [rad/s], along the axes of `frame`.
    """
    if (joints is None) == (twist is None):
        raise BadArgument(because("argument.jog.which", joints="joints", twist="twist"))
    if joints is not None:
        speeds = named_joints(arm, joints, "joints")
        for name, speed in speeds.items():
            require_joint_speed(arm, name, speed)
        return JogCommand(name=tuple(speeds), velocity=tuple(speeds.values()))
    values = tuple(twist or ())
    if len(values) not in (3, 6):
        raise BadArgument(because("argument.jog.twist", argument="twist", count=len(values)))
    values = vector("twist", values, len(values), "twist")
    for index, value in enumerate(values):
        unit, most = ("m", FASTEST) if index < 3 else ("rad", FASTEST_TURN)
        if hint := _other_unit(value, unit, most):
            raise BadArgument(
                because("argument.jog.fast_tool", hint, argument="twist", value=value, unit=unit, most=most)
            )
    if frame not in ("", arm.base_frame, arm.tool_frame):
        raise BadArgument(
            because("argument.jog.frame", argument="frame", frame=frame, base=arm.base_frame, tool=arm.tool_frame)
        )
    in_tool = arm.tool_frame if frame == arm.tool_frame else ""
    return JogCommand(linear=values[:3], angular=values[3:], frame=in_tool)


def require_joint_speed(arm: ArmDescription, name: str, value: float) -> None:
    """Raises `BadArgument` where `value` [rad/s] or [m/s] was meant in degrees or millimetres."""
    unit, most = arm.joint(name).unit, arm.joint(name).velocity
    if hint := _other_unit(value, unit, most):
        raise BadArgument(because("argument.jog.fast", hint, joint=name, value=value, unit=unit, most=most))


def _other_unit(value: float, unit: str, most: float) -> Remedy | None:
    """Of a speed that is more than twice `most` as it stands, and not so in degrees or millimetres."""
    factor, helper = (
        (math.radians(1.0), "in_degrees_per_second") if unit == "rad" else (0.001, "in_millimetres_per_second")
    )
    is_other = abs(value) > 2.0 * most and abs(value) * factor <= 2.0 * most
    return remedy(helper, value=value) if is_other else None
