"""An action on its way to the arm: within limits, not too far, the first one planned, what is in the way said."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping

import gemelo
from gemelo.schemas.reasons import because

from .readings import Readings

PAUSE = 0.5  # [s] without a target, after which the next one is the first: the gateway's stream has ended by then
WARN_EVERY = 1.0  # [s] between two warnings about what is in the way

log = logging.getLogger("lerobot_robot_gemelo")


class Follower:
    """Streams targets to one arm; a stream begins with the first target, and again after a pause."""

    def __init__(
        self,
        arm: gemelo.Arm,
        readings: Readings,
        *,
        most: Mapping[str, float],
        far: Mapping[str, float],
        plan_first: bool,
        guard: bool,
    ) -> None:
        """`most`: how far a target may be from its joint, `far`: from where on a first one is planned, [rad] or [m]."""
        self._arm, self._readings = arm, readings
        self._plan_first, self._guard = plan_first, guard
        self._joints = {joint.name: joint for joint in arm.description.joints}
        self._most, self._far = most, far
        self._sent: dict[str, float] = {}  # the last target, [rad] or [m] by joint
        self._sent_at = -math.inf  # [s] monotonic
        self._warned_at = -math.inf
        self._count, self._first_at = 0, 0.0

    @property
    def is_streaming(self) -> bool:
        """True if the gateway may still follow the last target."""
        return self._now() - self._sent_at < 2.0 * PAUSE

    @property
    def rate(self) -> float:
        """[Hz] of the targets since the first one, pauses included; 0 for fewer than two."""
        span = self._sent_at - self._first_at
        return (self._count - 1) / span if self._count > 1 and span > 0.0 else 0.0

    def follow(self, wanted: dict[str, float]) -> dict[str, float]:
        """Sends what may be sent of `wanted` [rad] or [m] by joint, and returns it; raises what gemelo raises."""
        at = self._readings.joints
        if self._now() - self._sent_at > PAUSE:
            self._go_near(at, wanted)
            at = self._arm.joints  # after the move
        target = self._free({name: self._bounded(name, value, at[name]) for name, value in wanted.items()}, at)
        status = self._arm.stream(target)
        if status is not None and status.limited_by:
            self._warn("the arm stops before its target", status.why or status.limited_by)
        self._note(target)
        return target

    def _go_near(self, at: Mapping[str, float], wanted: dict[str, float]) -> None:
        """A first target that is far away is no jump: the arm goes there by a plan, around what is in the way."""
        apart = {name: abs(value - at[name]) / self._far[name] for name, value in wanted.items()}
        farthest = max(apart, key=apart.__getitem__, default="")
        if not farthest or apart[farthest] <= 1.0:
            return
        if not self._plan_first:
            distance, unit = abs(wanted[farthest] - at[farthest]), self._joints[farthest].unit
            far = because("lerobot.far", joint=farthest, distance=distance, unit=unit)
            raise gemelo.Refused(because("client.refused", far), check="first target", subject=farthest, reason=far)
        log.info("the first target is far away: the arm goes there by a plan")
        self._arm.move(joints=wanted)

    def _bounded(self, name: str, value: float, at: float) -> float:
        """[rad] or [m], no farther from where the joint is than `max_relative_target`, and within its limits."""
        most = self._most.get(name, math.inf)
        return self._joints[name].clamp(min(max(value, at - most), at + most))

    def _free(self, target: dict[str, float], at: Mapping[str, float]) -> dict[str, float]:
        """The target, or the last that was sent where the arm may not stand at it."""
        if not self._guard:
            return target
        try:
            self._arm.check(target)
        except gemelo.Refused as refused:
            self._warn("a target was not sent", refused)
            return {name: self._sent.get(name, at[name]) for name in target}
        return target

    def _warn(self, what: str, why: object) -> None:
        if self._now() - self._warned_at > WARN_EVERY:
            self._warned_at = self._now()
            log.warning("%s: %s", what, why)

    def _note(self, target: dict[str, float]) -> None:
        self._sent_at = self._now()
        self._first_at = self._first_at if self._count else self._sent_at
        self._sent |= target
        self._count += 1

    def _now(self) -> float:
        return self._arm.node.monotonic()
