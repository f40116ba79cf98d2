"""The gripper: opening, closing, and what it then carries."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from gemelo.api.arguments import Grip
from gemelo.api.errors import Aborted, BadArgument, Canceled, Interrupted, Lost, Refused, reason_of, why_of
from gemelo.api.motion import check_of, why_ended
from gemelo.api.scene import Scene
from gemelo.api.session import Session
from gemelo.api.targets import number
from gemelo.libraries.runtime import errors as runtime
from gemelo.libraries.runtime.actions.client import ActionClient
from gemelo.libraries.runtime.actions.goal_handle import GoalHandle
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import InjectKind, InjectRequest
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult, GripperState
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.scene import SceneGrip, SceneRelease
from gemelo.schemas.topics import DEVICE_INJECT, DEVICE_STATUS, GRIPPER_COMMAND, GRIPPER_STATE

OPEN, CLOSE = "open", "close"
TO_ANSWER = 3.0  # [s] for an injection into a virtual device
TO_STAY = 3.0  # [s] that a gripper which was cancelled may take to say so

IsCancelled = Callable[[], bool]
OnGripping = Callable[[GripperCommandFeedback], object]
Handle = GoalHandle[GripperCommandFeedback, GripperCommandResult]


class Gripped(NamedTuple):
    """How the gripper has ended; as a text, one line for a person.

    >>> opened = arm.grip("open")
    >>> opened.reached, opened.stalled, opened.held
    (True, False, '')
    >>> print(opened)
    50.0 mm, there
    """

    position: float  # [m] between the jaws
    effort: float  # [N] that it presses with by its data sheet; 0 where nothing is between the jaws
    reached: bool  # it is where it was told to go
    stalled: bool  # something keeps the jaws apart
    measured: bool  # a sensor has read the opening; False: it is what was commanded
    held: str  # name of the scene's object that it carries from now on; empty for none
    released: str  # name of the one that it carries no more

    @property
    def summary(self) -> Reason:
        """One line for a person, as data.

        >>> arm.grip("open").summary.values["how"]
        'there'
        """
        how = ("stopped" if self.stalled else "there") + ("" if self.measured else "_commanded")
        opening = 1e3 * self.position  # [mm]
        if self.held:
            return because("gripper.ended.holds", opening=opening, how=how, object=self.held)
        if self.released:
            return because("gripper.ended.released", opening=opening, how=how, object=self.released)
        return because("gripper.ended", opening=opening, how=how)

    def __str__(self) -> str:
        """One line for a person."""
        return str(self.summary)


class Gripping:
    """The gripper of one connection."""

    def __init__(self, session: Session, scene: Scene) -> None:
        self._session, self._scene = session, scene
        self._client: ActionClient[GripperCommandGoal, GripperCommandFeedback, GripperCommandResult] | None = None

    def go(
        self, to: Grip, max_effort: float, on_progress: OnGripping | None, is_cancelled: IsCancelled | None = None
    ) -> Gripped:
        """Sends the goal of at most `max_effort` [N] and waits; attaches and detaches in the scene.

        Raises `Refused`, `Aborted`, `Lost`.
        """
        gripper = self._gripper()
        position = opening_of(gripper, to)
        if isinstance(gripper.drive, PulseDrive) and self._is_virtual() and not self._holds():
            self._put_between(position)
        before = self._session.newest(GRIPPER_STATE)
        goal = GripperCommandGoal(position=position, max_effort=max_effort)
        result = self._carried_out(goal, on_progress, is_cancelled)
        held, released = "", ""
        if opens(gripper, before, position):
            released = self._scene.edit(SceneRelease(opening=result.position)).name
        elif result.stalled or (not result.measured and position < gripper.open):
            held = self._scene.edit(SceneGrip(opening=result.position)).name
        return Gripped(
            result.position, result.effort, result.reached_goal, result.stalled, result.measured, held, released
        )

    def _gripper(self) -> Gripper:
        gripper = self._session.description.gripper
        if gripper is None:
            raise Refused(because("client.no_gripper", robot=self._session.description.name), check="gripper")
        return gripper

    def _is_virtual(self) -> bool:
        return self._session.newest(DEVICE_STATUS).virtual

    def _holds(self) -> bool:
        """The jaws have closed on an object of the scene."""
        return any(item.gripped for item in self._scene.objects.values())

    def _put_between(self, position: float) -> None:
        """A virtual servo meets what the scene has between its jaws, where that is wider than the goal."""
        width = self._scene.edit(SceneGrip(look=True)).width
        request = InjectRequest(kind=InjectKind.OBJECT, value=width if width > position else 0.0)
        answer = self._session.call(DEVICE_INJECT, request, TO_ANSWER)
        if not answer.accepted and width <= position:
            why = why_of(answer)
            raise Refused(because("client.device.refused", why), check="device", reason=why)

    def _carried_out(
        self, goal: GripperCommandGoal, on_progress: OnGripping | None, is_cancelled: IsCancelled | None
    ) -> GripperCommandResult:
        handle = self._sent(goal)
        try:
            self._await(handle, on_progress, is_cancelled)
        except KeyboardInterrupt:
            handle.cancel()
            self._session.wait_for(lambda: handle.is_over, TO_STAY)
            raise Interrupted(because("client.gripper.interrupted")) from None
        self._session.changed()
        if handle.outcome is None:
            raise Lost(reason_of(handle.lost), has_begun=True)
        status, result = handle.outcome.status, handle.outcome.result
        if status is not GoalStatusCode.SUCCEEDED:
            why = why_ended(result)
            kind = Canceled if status is GoalStatusCode.CANCELED else Aborted
            message = because("ended.gripper", why, status=status.name, position=result.position)
            raise kind(message, status, reason=why)
        return result

    def _sent(self, goal: GripperCommandGoal) -> Handle:
        client = self._client = self._client or self._session.node.action(GRIPPER_COMMAND)
        try:
            handle = client.send(goal, lambda feedback: self._session.notify(), attached=True)
        except runtime.GoalRefused as error:
            check = check_of(error, "gripper")
            said = because("refused.by", error.reason, server=client.action.server)
            raise Refused(said, check=check, code=error.code, reason=error.reason) from error
        except runtime.RequestRefused as error:
            raise Refused(reason_of(error)) from error
        except (runtime.NoAnswer, runtime.BusError) as error:
            raise Lost(reason_of(error)) from error
        handle.on_end = self._session.notify
        return handle

    def _await(self, handle: Handle, on_progress: OnGripping | None, is_cancelled: IsCancelled | None) -> None:
        told: list[GripperCommandFeedback | None] = [None]

        def tell() -> None:
            if on_progress is not None and handle.feedback is not None and handle.feedback is not told[0]:
                told[0] = handle.feedback
                on_progress(handle.feedback)

        def wants_end() -> bool:
            return handle.is_over or (is_cancelled is not None and is_cancelled())

        self._session.wait_for(wants_end, None, tell)
        if not handle.is_over:
            handle.cancel()
            self._session.wait_for(lambda: handle.is_over, TO_STAY)


def opens(gripper: Gripper, before: GripperState, position: float) -> bool:
    """True if the jaws go apart on their way to `position` [m]: what they have held is let go.

    Jaws of which nothing is known open where they are to be open.
    """
    if not before.known:
        return position >= gripper.open
    return position > before.position + gripper.tolerance


def opening_of(gripper: Gripper, to: Grip) -> float:
    """[m] that "open", "close" or a length means; raises `BadArgument`."""
    if isinstance(to, str):
        if to not in (OPEN, CLOSE):
            raise BadArgument(because("argument.grip.word", value=to))
        return gripper.open if to == OPEN else gripper.closed
    position = number("grip", to)
    if not gripper.closed <= position <= gripper.open:
        is_other = 1.0 <= position <= 1000.0 * gripper.open
        hint = (remedy("millimetres_are", value=position, metres=position / 1000.0),) if is_other else ()
        limits = {"least": gripper.closed, "most": gripper.open}
        raise BadArgument(because("argument.grip.range", *hint, value=position, **limits))
    return position
