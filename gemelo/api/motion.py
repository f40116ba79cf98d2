"""A motion under way: how far it is, how it ended, and the rule that no motion runs unwatched."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from gemelo.api.errors import Aborted, Canceled, Error, Interrupted, Lost, Refused, reason_of
from gemelo.api.planning import Plan, words_of
from gemelo.api.session import Session
from gemelo.libraries.runtime import errors as runtime
from gemelo.libraries.runtime.actions.client import ActionClient
from gemelo.libraries.runtime.actions.goal_handle import ActionOutcome, GoalHandle
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.gripper import GripperCommandResult
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
)
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY

Handle = GoalHandle[FollowJointTrajectoryFeedback, FollowJointTrajectoryResult]
Client = ActionClient[FollowJointTrajectoryGoal, FollowJointTrajectoryFeedback, FollowJointTrajectoryResult]

OnMotion = Callable[["Motion"], object]

ENDED = {
    GoalStatusCode.ABORTED: "ended.aborted",
    GoalStatusCode.CANCELED: "ended.canceled",
    GoalStatusCode.PREEMPTED: "ended.preempted",
}
BRAKING = 10.0  # [s] that a cancelled motion may take to come to rest before it counts as lost


class Motion:
    """One plan that is being executed, or was.

    >>> motion = arm.start(named="left")
    >>> motion.wait()
    <Motion rm1: named='left', succeeded ...>
    """

    def __init__(self, session: Session, plan: Plan, detached: bool) -> None:
        self.plan = plan
        self.is_detached = detached  # it goes on when this script ends
        self._session = session
        self._handle: Handle | None = None
        self._wants_cancel = False

    @property
    def feedback(self) -> FollowJointTrajectoryFeedback | None:
        """What the gateway says 20 times a second: desired, actual, error; None before the first.

        >>> motion = arm.move(named="left")
        >>> motion.feedback.joint_names == arm.joint_names
        True
        """
        return self._handle.feedback if self._handle is not None else None

    @property
    def progress(self) -> float:
        """The share of the trajectory's time that is over, 0 to 1.

        >>> arm.move(named="left").progress
        1.0
        """
        if self.status is GoalStatusCode.SUCCEEDED:
            return 1.0
        return min(1.0, self.elapsed / self.plan.duration) if self.plan.duration > 0.0 else 0.0

    @property
    def elapsed(self) -> float:
        """[s] along the trajectory.

        >>> motion = arm.move(named="left")
        >>> 0.0 < motion.elapsed <= motion.plan.duration
        True
        """
        return self.feedback.elapsed if self.feedback is not None else 0.0

    @property
    def status(self) -> GoalStatusCode:
        """ACCEPTED, EXECUTING, CANCELING, or how it ended: SUCCEEDED, CANCELED, ABORTED, PREEMPTED.

        >>> arm.move(named="left").status.name
        'SUCCEEDED'
        """
        self._session.clock.look()
        return self._handle.status if self._handle is not None else GoalStatusCode.UNKNOWN

    @property
    def is_over(self) -> bool:
        """True once it has ended, or the gateway is lost.

        >>> arm.move(named="left").is_over
        True
        """
        self._session.clock.look()
        return self._has_ended()

    def _has_ended(self) -> bool:
        return self._handle is not None and self._handle.is_over

    @property
    def result(self) -> FollowJointTrajectoryResult:
        """How exactly it arrived: commanded and executed steps, final and largest following error [steps].

        Raises `Error` while it is under way, and where the gateway was lost.

        >>> result = arm.move(named="left").result
        >>> result.executed_steps == result.commanded_steps, max(map(abs, result.final_error)) <= 0.5
        (True, True)
        """
        if self._outcome is None:
            raise Error(because("client.motion.no_result"))
        return self._outcome.result

    @property
    def stopped_at(self) -> dict[str, float]:
        """[rad] or [m] by joint, where it ended, from the steps that were read back; empty before its end,
        and where the board does not say what it has executed.

        >>> abs(arm.move(joints={"brazo_joint": 0.2}).stopped_at["brazo_joint"] - 0.2) < 0.001
        True
        """
        if self._outcome is None:
            return {}
        result, arm = self._outcome.result, self._session.description
        steps = zip(result.joint_names, result.executed_steps, strict=False)
        return {name: arm.joint(name).steps.to_position(count) for name, count in steps}

    @property
    def goal_id(self) -> str:
        """Under which the gateway knows it.

        >>> len(arm.move(named="left").goal_id) > 8
        True
        """
        return self._handle.goal_id if self._handle is not None else ""

    @property
    def _outcome(self) -> ActionOutcome[FollowJointTrajectoryResult] | None:
        return self._handle.outcome if self._handle is not None else None

    def cancel(self) -> None:
        """The arm decelerates on its path; returns at once, `wait` returns when it rests.

        >>> motion = arm.start(named="left", speed=0.2)
        >>> motion.cancel()
        >>> motion.wait().status.name
        'CANCELED'
        """
        self._wants_cancel = True
        if self._handle is not None:
            self._handle.cancel()

    def wait(
        self,
        timeout: float | None = None,
        on_progress: OnMotion | None = None,
        on_cancel: OnMotion | None = None,
    ) -> Motion:
        """Returns the motion when it has succeeded, or was cancelled by `cancel`; calls `on_progress` in between.

        Raises `Aborted`, `Canceled`, `Lost`, and TimeoutError after `timeout` [s]: then it goes on. At Ctrl-C the arm
        decelerates, `on_cancel` is called meanwhile (a warning is logged if there is none), and `Interrupted` is raised
        when it rests.

        >>> arm.start(named="left").wait(timeout=60.0).status.name
        'SUCCEEDED'
        """
        with self._braked_by_interrupt(on_cancel):
            is_over = self._await(timeout, on_progress)
        if not is_over:
            raise TimeoutError(f"the motion has not ended within {timeout:g} s; it goes on: wait() again, or cancel()")
        self._session.changed()
        return self._ended()

    @contextmanager
    def _braked_by_interrupt(self, on_cancel: OnMotion | None) -> Iterator[None]:
        """At Ctrl-C the arm decelerates, and `Interrupted` is raised when it rests; a second one leaves at once."""
        try:
            yield
        except KeyboardInterrupt as error:
            if self._wants_cancel or self.is_over or isinstance(error, Interrupted):
                raise
            if self._handle is None:
                raise Interrupted(because("client.motion.not_begun")) from None
            raise self._interrupted(on_cancel) from None

    def _send(self, client: Client, goal: FollowJointTrajectoryGoal) -> None:
        """Raises `Refused` with the gateway's reason, or `Lost`. Called once, by `start`."""
        try:
            self._handle = client.send(goal, lambda feedback: self._session.notify(), attached=not self.is_detached)
        except runtime.GoalRefused as error:
            check = check_of(error, "execution")
            said = because("refused.by", error.reason, server=client.action.server)
            raise Refused(said, check=check, code=error.code, reason=error.reason) from error
        except runtime.RequestRefused as error:
            raise Refused(reason_of(error)) from error
        except (runtime.NoAnswer, runtime.BusError) as error:
            raise Lost(reason_of(error)) from error
        except KeyboardInterrupt:
            raise Interrupted(because("client.motion.as_it_began")) from None
        self._handle.on_end = self._session.notify

    def _await(self, timeout: float | None, on_progress: OnMotion | None) -> bool:
        told: list[Any] = [None]

        def tell() -> None:
            if on_progress is not None and self.feedback is not told[0]:
                told[0] = self.feedback
                on_progress(self)

        return self._session.wait_for(self._has_ended, timeout, tell if on_progress is not None else None)

    def _interrupted(self, on_cancel: OnMotion | None) -> Interrupted:
        """Decelerates and waits for the rest; a second Ctrl-C leaves this at once. Raises `Lost`."""
        self.cancel()
        if on_cancel is not None:
            on_cancel(self)
        else:
            self._session.node.log.warning("Ctrl-C: the arm slows down on its path (again: leave without waiting)")
        if not self._session.wait_for(lambda: self.is_over, BRAKING):
            return Interrupted(because("client.motion.not_at_rest", time=BRAKING))
        self._session.changed()
        ended = self._require_outcome()
        said = because("client.motion.interrupted", motion=repr(self))
        return Interrupted(said, self.stopped_at, ended.status, ended.result)

    def _ended(self) -> Motion:
        outcome = self._require_outcome()
        status, result = outcome.status, outcome.result
        if status is GoalStatusCode.SUCCEEDED or (status is GoalStatusCode.CANCELED and self._wants_cancel):
            return self
        kind = Canceled if status is GoalStatusCode.CANCELED else Aborted
        why = why_ended(result)
        message = because(ENDED.get(status, "ended.aborted"), why, time=result.duration)
        raise kind(message, status, result.error_code, self.stopped_at, result, reason=why)

    def _require_outcome(self) -> ActionOutcome[FollowJointTrajectoryResult]:
        """How it ended; raises `Lost` where the gateway was lost before."""
        assert self._handle is not None
        if self._handle.outcome is None:
            raise Lost(reason_of(self._handle.lost), has_begun=True)
        return self._handle.outcome

    def __repr__(self) -> str:
        about = f"<Motion {self.plan.robot}: {words_of(self.plan.target) or 'as requested'}, {self.status.name.lower()}"
        if self._outcome is None:
            return f"{about}, {self.progress:.0%}>"
        result = self._outcome.result
        if not result.verified:
            return f"{about} in {result.duration:.2f} s, {result.error_string}>"
        errors = ", ".join(
            f"{name} {error:+.2f}" for name, error in zip(result.joint_names, result.final_error, strict=False)
        )
        why = f": {result.error_string}" if result.error_string else ""
        return f"{about} in {result.duration:.2f} s{why}, final error [steps] {errors}>"


def why_ended(result: FollowJointTrajectoryResult | GripperCommandResult) -> Reason:
    """Why a goal ended before its end; of an older gateway, which sends no data, its sentence."""
    if result.why is not None:
        return result.why
    return plain(result.error_string) if result.error_string else because("ended.unexplained")


def check_of(refused: runtime.GoalRefused, usual: str) -> str:
    """The check that the gateway's refusal of a goal is about."""
    return "control" if refused.code == FollowErrorCode.NOT_IN_CONTROL else usual


class MotionRegistry:
    """All motions of one connection: sends them, and cancels those that are attached when it closes."""

    def __init__(self, session: Session, check: Callable[[], None]) -> None:
        """`check` raises `Refused` where nothing may move."""
        self._session, self._check = session, check
        self._client: Client | None = None
        self._started: list[Motion] = []

    def run(self, plan: Plan, detached: bool, on_progress: OnMotion | None, on_cancel: OnMotion | None) -> Motion:
        """Sends the plan's trajectory and waits for its end; a Ctrl-C between the two cancels it as well."""
        motion = Motion(self._session, plan, detached)
        with motion._braked_by_interrupt(on_cancel):
            self._start(motion)
            return motion.wait(on_progress=on_progress, on_cancel=on_cancel)

    def start(self, plan: Plan, detached: bool, after: Motion | None = None) -> Motion:
        """Sends the plan's trajectory, to begin at the end of the motion `after`; raises `Refused` or `Lost`."""
        return self._start(Motion(self._session, plan, detached), after)

    def _start(self, motion: Motion, after: Motion | None = None) -> Motion:
        self._check()
        client = self._client = self._client or self._session.node.action(FOLLOW_JOINT_TRAJECTORY)
        plan = motion.plan
        self._started = [each for each in self._started if not each.is_over] + [motion]
        goal = FollowJointTrajectoryGoal(
            trajectory=plan.trajectory,
            scene_version=plan.response.scene_version,
            scene_epoch=plan.response.scene_epoch,
            after=after.goal_id if after is not None else "",
        )
        try:
            motion._send(client, goal)
        except BaseException:
            self._started.remove(motion)
            raise
        return motion

    def bring_to_rest(self) -> None:
        """Decelerates what this connection has started and returns when it rests; raises `Lost` where that is not said
        in time."""
        running = [motion for motion in self._started if not motion.is_over]
        for motion in running:
            motion.cancel()
        if running and not self._session.wait_for(lambda: all(motion.is_over for motion in running), BRAKING):
            raise Lost(because("lost.rest", time=BRAKING))
        if running:
            self._session.changed()

    def cancel_attached(self) -> None:
        """Decelerates what this connection has started and nobody waits for, and waits until it rests."""
        running = [motion for motion in self._started if not motion.is_detached and not motion.is_over]
        for motion in running:
            motion.cancel()
        if running:
            self._session.wait_for(lambda: all(motion.is_over for motion in running), BRAKING)
