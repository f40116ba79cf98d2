"""The errors of the API: each is a reason, with its sentence in the terms of a script, and fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Protocol

from gemelo.api.arguments import Target
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.motion import FollowJointTrajectoryResult
from gemelo.schemas.planning import Refusal
from gemelo.schemas.reasons import FrontEnd, Reason, plain, say
from gemelo.schemas.scene import Contact

if TYPE_CHECKING:
    from gemelo.api.homing_report import HomingReport


def as_reason(text: Reason | str) -> Reason:
    """A sentence without a code is a reason too."""
    return text if isinstance(text, Reason) else plain(text)


class Explaining(Protocol):
    """An answer or a state of another part that says why not."""

    @property
    def reason(self) -> str: ...
    @property
    def why(self) -> Reason | None: ...


def why_of(answer: Explaining) -> Reason:
    """Why not; of an older part, which sends no data, its sentence."""
    return answer.why or plain(answer.reason)


def reason_of(error: Exception | None) -> Reason:
    """Why, as another part's error says it."""
    found = getattr(error, "reason", None)
    return found if isinstance(found, Reason) else plain(str(error))


class Error(ReasonedError):
    """Every error of this package but Ctrl-C. `reason` is why, as data; `message` the whole sentence, as data too.

    >>> try:
    ...     arm.move(named="nowhere")
    ... except gemelo.Error as error:
    ...     print(error)
    no named state "nowhere"; known are folded, home, left, lifted, ready, right
    """

    def __init__(self, message: Reason | str = "", reason: Reason | str = "") -> None:
        """`reason`: that within `message` which a program looks at; the message itself where it is left out."""
        super().__init__(reason or message)
        self.message = as_reason(message)

    def __str__(self) -> str:
        return say(self.message, front_end=FrontEnd.SCRIPT)


class BadArgument(Error, ValueError):
    """An argument that cannot be meant: unknown, contradictory, not finite, or in another unit. Nothing was asked.

    >>> try:
    ...     arm.move(joints={"brazo_joint": 30})
    ... except gemelo.BadArgument as error:
    ...     print(error)
    joint "brazo_joint": 30 rad is beyond its limits, ... rad: if it is in degrees, write gemelo.deg(30)
    """


class Refused(Error):
    """What was asked cannot be done, and nothing has moved. The text says why, and what would do.

    >>> try:
    ...     arm.move(position=(0.6, 0.1, 0.1))
    ... except gemelo.Refused as refused:
    ...     print(refused.check, refused.nearest)
    ...     motion = arm.move(**refused.nearest)
    reach {'position': (0.4..., 0.06..., 0.1)}
    """

    def __init__(
        self,
        message: Reason | str,
        *,
        check: str = "",
        subject: str = "",
        value: float | None = None,
        limit: float | None = None,
        nearest: Target | None = None,
        remedy: str = "",
        configuration: Mapping[str, float] | None = None,
        nearest_free: Mapping[str, float] | None = None,
        code: int = 0,
        reason: Reason | str = "",
        refusal: Refusal | None = None,
        contacts: Sequence[Contact] = (),
    ) -> None:
        super().__init__(message, reason)  # the reason is that of the planner, the gateway or the device
        self.refusal = refusal  # the planner's own message; None where another refuses
        self.check = check  # what was checked, as "reach", "joint limit", "collision"; empty where the device refuses
        self.subject = subject  # the joint, pair of links, or axis of the pose
        self.value = value  # of the subject, in the unit of the check
        self.limit = limit  # that the value is beyond
        self.nearest: Target = nearest or {}  # the nearest goal that can, as arguments: `arm.move(**refused.nearest)`
        self.remedy = remedy  # what a person can do
        self.configuration = dict(configuration or {})  # [rad] or [m] by joint, where the arm would touch something
        self.nearest_free = dict(nearest_free or {})  # [rad] or [m] by joint, the nearest to a start that touches
        self.code = code  # PlanCode of the planner, FollowErrorCode of the gateway
        self.contacts = tuple(contacts)  # of `Arm.check`: the pairs that are too near, each with its point


class Aborted(Error):
    """A motion that ended before its goal: a fault, a tolerance, a newer goal, a device command.

    >>> try:
    ...     arm.execute(arm.plan(named="left"))
    ... except gemelo.Aborted as aborted:
    ...     print(aborted.status.name, aborted.stopped_at)
    <Motion rm1: ...>
    """

    def __init__(
        self,
        message: Reason | str,
        status: GoalStatusCode = GoalStatusCode.ABORTED,
        code: int = 0,
        stopped_at: Mapping[str, float] | None = None,
        result: FollowJointTrajectoryResult | None = None,
        homing: HomingReport | None = None,
        reason: Reason | str = "",
    ) -> None:
        super().__init__(message, reason)
        self.status = status  # ABORTED, PREEMPTED or CANCELED
        self.code = code  # FollowErrorCode
        self.stopped_at = dict(stopped_at or {})  # [rad] or [m] by joint, from the steps that were read back
        self.result = result  # of the motion: executed steps and errors
        self.homing = homing  # how far it came, where it was a homing


class Canceled(Aborted):
    """A motion that somebody else has cancelled: the arm decelerated on its path.

    >>> issubclass(gemelo.Canceled, gemelo.Aborted)
    True
    """


class Lost(Error):
    """Nobody answers: the twin does not run, or a part of it fell silent. What became of a motion is not known.

    >>> gemelo.connect("parol6")
    Traceback (most recent call last):
    gemelo.api.errors.Lost: no stepper_gateway of parol6 at the router ...; there is rm1: gemelo.connect("rm1")
    """

    def __init__(self, message: Reason | str, robots: tuple[str, ...] = (), has_begun: bool = False) -> None:
        super().__init__(message)
        self.has_begun = has_begun  # True where a motion was under way, of which nothing more is heard
        self.robots = robots  # the arms that are on the router, where the one asked for is not


class Interrupted(KeyboardInterrupt):
    """Ctrl-C: the arm has come to rest on its path before this is raised; a second Ctrl-C does not wait for that.

    >>> issubclass(gemelo.Interrupted, KeyboardInterrupt)
    True
    """

    def __init__(
        self,
        message: Reason | str,
        stopped_at: Mapping[str, float] | None = None,
        status: GoalStatusCode = GoalStatusCode.UNKNOWN,
        result: FollowJointTrajectoryResult | None = None,
        homing: HomingReport | None = None,
    ) -> None:
        self.message = self.reason = as_reason(message)
        super().__init__(say(self.message, front_end=FrontEnd.SCRIPT))
        self.status = status  # how the motion ended: CANCELED, or SUCCEEDED where it had just arrived
        self.result = result  # of the motion: executed steps and errors; None where nothing moved, or it is not known
        self.stopped_at = dict(stopped_at or {})  # [rad] or [m] by joint; empty where it is not known
        self.homing = homing  # how far it came, where it was a homing


def imported(module: str) -> ModuleType:
    """The module; raises `Error`, which names the extra, where a package is missing that a client goes without."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        from gemelo.libraries.runtime.extras import missing_extra  # for who lacks one alone

        if (reason := missing_extra(error)) is None:
            raise
        raise Error(reason) from error
