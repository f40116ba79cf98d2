"""Jogging: the newest command and where the arm is, fifty times a second, to the next target and what limits it.

A target is where the arm comes to rest from the velocity it is to have: the gateway, which approaches targets at rest,
then follows without lag, and where the targets cease the arm stops in room that was found free.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.planning import JogCommand, JogLimit, JogStatus
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.braking import Braking
from gemelo.services.planner.jog.jog_command import (
    BadJog,
    DesiredVelocity,
    JogInterpreter,
    JogRefused,
    standing_position,
)
from gemelo.services.planner.jog.jog_limits import no_command, singularity, worded
from gemelo.services.planner.jog.velocity_limiter import VelocityLimiter

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
PERIOD = 0.02  # [s] between two steps, however late they come: a late step makes the arm slower, never faster
DEAD_MAN = 0.1  # [s] without a command until the arm brakes; standard: MoveIt Servo's command time-out
STATUS_PERIOD = 0.1  # [s] chosen: ten words a second are smooth for a person's eye
SILENCE = 0.6  # [s] without a command after which an interrupted jog may begin again; the gateway wants 0.5
FOLLOW = 0.6  # [s] that the arm may be behind its targets, with the gateway's lead and the states' way back
GRACE = 0.2  # [s] that it may be elsewhere; chosen: ten states of the device
STEPS_ASTRAY = 3.0  # [steps] that are no straying; chosen: rounding at both ends, and one more
FADING = 1.0  # [s] in which a tool brakes on its line; chosen: beyond any arm's braking time at jogging speed
LAST = 0.02  # of the twist, that is given up off the line
MOST_SAID = 100  # different complaints about commands; more is a client gone mad
ARRIVAL = 1.5  # [s] that the target is repeated at most until the arm has come to rest there
NEVER = -1.0e9  # [s] chosen: before every monotonic clock's beginning


@dataclass(frozen=True)
class JogOutput:
    """What a step has to say: a target while the arm is led, a status now and then, a sentence once."""

    targets: JointTargets | None = None
    status: JogStatus | None = None
    said: str = ""


class Jog:
    """Leads one arm; times are [s] of one monotonic clock."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, world: World) -> None:
        self._arm = arm
        self._interpreter = JogInterpreter(kinematics)
        self._braking = Braking(arm, PERIOD)
        self._world = world
        self._limiter = VelocityLimiter(arm, world, self._braking)
        self._command = JogCommand()
        self._heard = self._told = self._rested = self._on_way = NEVER
        self._is_heard = False
        self._interrupted_by: Reason | None = (
            None  # what has ended the jog while it was commanded: to be let go before it begins again
        )
        self._known: set[str] = set()  # sentences that have been said
        self._trail: deque[tuple[float, Array]] = deque()
        self._positions: Array | None = None  # commanded, where the jog leads; None: it leads nothing
        self._velocity: Array = np.zeros(len(arm.joints))
        self._scale = 1.0
        self._limits: tuple[JogLimit, ...] = ()

    @property
    def is_busy(self) -> bool:
        """True if there is anything to do for a step."""
        return self._positions is not None or self._is_heard

    @property
    def commanded(self) -> tuple[Array, Array] | None:
        """Position [rad] or [m] and velocity [rad/s] or [m/s], (n,) each, that the arm is to have now; None while it is
        not led."""
        return None if self._positions is None else (self._positions.copy(), self._velocity.copy())

    def set_world(self, world: World) -> None:
        """What counts from the next step on."""
        self._world = world
        self._limiter = VelocityLimiter(self._arm, world, self._braking)

    def on_command(self, command: JogCommand, now: float) -> None:
        """Takes a command that has come at `now` [s]; the newest one counts."""
        if now - self._heard > SILENCE:
            self._interrupted_by = None
        self._command, self._heard = command, now
        self._is_heard = True

    def step(
        self,
        now: float,
        stamp: int,
        present: JointState | None,
        age: float,
        goal_is_active: bool,
        not_ready: Reason | None = None,
    ) -> JogOutput:
        """One period; `present` is `age` [s] old, `stamp` is [ns] UNIX, `not_ready` why the device does not move."""
        self._is_heard = now - self._heard <= DEAD_MAN
        if not self.is_busy:
            return JogOutput()
        try:
            if self._positions is None:
                self._begin(present, age, goal_is_active, not_ready, now)
            said = self._lead(now)
            self._require_followed(present, age, goal_is_active, not_ready, now)
        except JogRefused as refused:
            return self._end(refused.reason, now, stamp)
        return self._output(now, stamp, present, said)

    def _begin(
        self, present: JointState | None, age: float, goal_is_active: bool, not_ready: Reason | None, now: float
    ) -> None:
        if goal_is_active:
            raise JogRefused(because("jog.goal_active", remedy("cancel_first")))
        if not_ready is not None:
            raise JogRefused(not_ready)
        if self._interrupted_by is not None:
            raise JogRefused(because("jog.interrupted", self._interrupted_by, remedy("let_go_for", time=SILENCE)))
        self._positions = np.array(standing_position(self._arm, present, age))
        self._velocity = np.zeros(len(self._arm.joints))
        self._limiter = VelocityLimiter(self._arm, self._world, self._braking)  # nothing of an earlier jog counts
        self._trail.clear()
        self._trail.append((now, self._positions))  # it stands there until its first target has come through
        self._rested = self._on_way = now

    def _lead(self, now: float) -> str:
        """Takes the next velocity; gives what there is to say about the command."""
        assert self._positions is not None
        there = self._positions + 0.5 * PERIOD * self._velocity  # halfway: the tool's line bends less
        wanted, said = self._wanted(there) if self._is_heard else (self._fading(there, now), "")
        singular = self._singularity_on if wanted.is_twist else None
        allowed = self._limiter.allowed(self._positions, self._velocity, wanted.velocity, singular)
        self._velocity = allowed.velocity
        self._positions = self._positions + PERIOD * allowed.velocity
        self._scale = wanted.scale * allowed.share
        self._limits = (*wanted.limits, *allowed.limits)
        return said

    def _singularity_on(self, displacement: Array) -> JogLimit | None:
        assert self._positions is not None
        regularity = self._interpreter.twists.singularity_on(self._positions, displacement)
        return None if regularity is None else singularity(regularity)

    def _wanted(self, positions: Array) -> tuple[DesiredVelocity, str]:
        """A command that cannot be followed is a stop; each reason is said once."""
        try:
            return self._interpreter.wanted(self._command, positions), ""
        except BadJog as error:
            said = "" if str(error) in self._known or len(self._known) >= MOST_SAID else str(error)
            self._known |= {said} - {""}
            return DesiredVelocity(np.zeros(len(positions)), 0.0, (no_command(error.reason),)), said

    def _fading(self, positions: Array, now: float) -> DesiredVelocity:
        """Less of the last twist, so that the tool brakes on its line; of joints, and after a while, nothing."""
        standing = DesiredVelocity(np.zeros(len(positions)))
        if now - self._heard > DEAD_MAN + FADING:
            return standing
        wanted, _ = self._wanted(positions)
        size = float(wanted.velocity @ wanted.velocity)
        if not wanted.is_twist or size == 0.0:
            return standing
        braked = self._braking.towards(self._velocity, standing.velocity)
        share = float(braked @ wanted.velocity) / size
        if share < LAST:
            return standing
        return DesiredVelocity(min(1.0, share) * wanted.velocity, is_twist=True)

    def _require_followed(
        self, present: JointState | None, age: float, goal_is_active: bool, not_ready: Reason | None, now: float
    ) -> None:
        """Raises `JogRefused` where somebody else moves the arm, or nobody does."""
        if goal_is_active:
            raise JogRefused(because("jog.goal_took_over"))
        if present is None or age > FOLLOW:
            raise JogRefused(not_ready or because("jog.no_states", remedy("see_gateway")))
        self._remember(now)
        astray = self._astray(present)
        if not astray and not_ready is None:
            self._on_way = now
        elif now - self._on_way > GRACE:
            raise JogRefused(not_ready or because("jog.not_following", remedy("see_state"), joint=astray))

    def _remember(self, now: float) -> None:
        assert self._positions is not None
        self._trail += ((now, self._positions), (now, self._target()))
        while now - self._trail[0][0] > FOLLOW:
            self._trail.popleft()

    def _astray(self, present: JointState) -> str:
        """The name of a joint that is not between its targets of late; empty if all are."""
        trail = np.array([positions for _, positions in self._trail])
        found = dict(zip(present.name, present.position, strict=False))
        for column, joint in enumerate(self._arm.joints):
            track, slack = trail[:, column], STEPS_ASTRAY * joint.steps.resolution
            place = found.get(joint.name, float(track[-1]))
            if not float(track.min()) - slack <= place <= float(track.max()) + slack:
                return joint.name
        return ""

    def _target(self) -> Array:
        """(n,) [rad] or [m] where each joint comes to rest by itself; within the limits."""
        assert self._positions is not None
        target = self._positions + self._braking.alone(self._velocity)
        return np.clip(target, self._braking.lower, self._braking.upper)

    def _output(self, now: float, stamp: int, present: JointState | None, said: str) -> JogOutput:
        target = tuple(self._target().tolist())
        rest = (0.0,) * len(target)
        targets = JointTargets(stamp=stamp, name=self._arm.joint_names, position=target, velocity=rest)
        if np.any(self._velocity) or self._is_heard:
            self._rested = now
        elif now - self._rested > ARRIVAL or (now - self._rested > DEAD_MAN and self._has_arrived(present)):
            self._positions = None
            return JogOutput(targets, JogStatus(stamp=stamp), said)
        return JogOutput(targets, self._status(now, stamp), said)

    def _has_arrived(self, present: JointState | None) -> bool:
        if present is None or any(present.velocity):
            return False
        found = dict(zip(present.name, present.position, strict=False))
        assert self._positions is not None
        return all(
            abs(found.get(joint.name, np.inf) - place) <= joint.steps.resolution
            for joint, place in zip(self._arm.joints, self._positions.tolist(), strict=True)
        )

    def _status(self, now: float, stamp: int) -> JogStatus | None:
        if now - self._told < STATUS_PERIOD - 0.5 * PERIOD or self._positions is None:
            return None
        self._told = now
        newest = tuple({limit.check: limit for limit in reversed(self._limits)}.values())[::-1]
        limits = tuple(worded(limit) for limit in newest)
        return JogStatus(
            stamp=stamp,
            active=True,
            scale=self._scale,
            limited_by="; ".join(limit.message for limit in limits),
            limits=limits,
            manipulability=self._interpreter.twists.manipulability(self._positions),
        )

    def _end(self, reason: Reason, now: float, stamp: int) -> JogOutput:
        """No more targets; what was led and is interrupted begins again only after a silence."""
        was_led, self._positions = self._positions is not None, None
        self._velocity = np.zeros(len(self._arm.joints))
        self._interrupted_by = reason if was_led else self._interrupted_by
        if not was_led and now - self._told < STATUS_PERIOD - 0.5 * PERIOD:
            return JogOutput()
        self._told = now
        said = str(reason)
        status = JogStatus(stamp=stamp, scale=0.0, limited_by=said, why=reason)
        return JogOutput(status=status, said=said if was_led else "")


def signed(output: JogOutput, client: str, told_to: str) -> tuple[JointTargets | None, JogStatus | None]:
    """Target and status as they are published: with the node that jogs, and the one that the status is about."""
    targets, status = output.targets, output.status
    return (
        None if targets is None else replace(targets, client=client),
        None if status is None else replace(status, client=told_to),
    )
