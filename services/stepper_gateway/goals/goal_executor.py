"""Goals of follow_joint_trajectory: accepted or refused, carried out, and ended with a reason."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from msgspec.structs import replace

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.system import LogLevel
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.goals.active_goal import ActiveGoal, GoalEnding
from gemelo.services.stepper_gateway.goals.goal_validator import GoalValidator, MotionStart, ValidatedGoal
from gemelo.services.stepper_gateway.goals.next_goal import CANCELED, NextGoal
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected, invalid
from gemelo.services.stepper_gateway.goals.scene_versions import PlannedIn, SceneVersions
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.moment import Moment, next_beat
from gemelo.services.stepper_gateway.motion.knot_sources import PathKnots
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.motion.paths import TimedPath
from gemelo.services.stepper_gateway.outputs import GoalExecuting, GoalFinished, GoalProgress

HELD = {  # the code, by the detail of the device's event
    "heartbeat": "ending.held.heartbeat",
    "command": "ending.held.command",
    "shutdown": "ending.held.shutdown",
}
HELD_SILENTLY = "ending.held.unexplained"
FAILED = GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED
PREEMPTED = GoalStatusCode.PREEMPTED, FollowErrorCode.PREEMPTED
SUCCEEDED = GoalEnding(GoalStatusCode.SUCCEEDED, FollowErrorCode.SUCCESSFUL)


class GoalVerdict(NamedTuple):
    """The answer to a goal request."""

    accepted: bool
    code: FollowErrorCode = FollowErrorCode.SUCCESSFUL
    reason: str = ""
    why: Reason | None = None  # the same as data

    @classmethod
    def refused(cls, code: FollowErrorCode, why: Reason) -> GoalVerdict:
        return cls(False, code, str(why), why)


class CancelVerdict(NamedTuple):
    """The answer to a cancel request."""

    why: Reason | None  # there is nothing to cancel; None: it is being cancelled


def as_not_verified(result: FollowJointTrajectoryResult) -> FollowJointTrajectoryResult:
    """The result of a device that does not say what it has executed: nothing is claimed of it."""
    return replace(result, executed_steps=(), max_following_error=(), final_error=(), verified=False)


class GoalExecutor:
    """At most one goal moves the arm; a newer one takes over from it, or follows it where it asks for that."""

    def __init__(self, device: GatewayDevice, controller: MotionController) -> None:
        self._device, self._controller = device, controller
        self.scenes = SceneVersions()
        self._validator = GoalValidator(device.joints, device.arm.device.tick_hz)
        self._current: ActiveGoal | None = None
        self._waiting: ActiveGoal | None = None  # until its stamp, or until the stream before it has ended
        self._next = NextGoal(controller)

    @property
    def is_active(self) -> bool:
        return self._current is not None or self._waiting is not None or self._next.goal is not None

    def use_tick(self, tick_hz: int) -> None:
        """The device's own figure for the tick that bounds step rates."""
        self._validator = GoalValidator(self._device.joints, tick_hz)

    def prepare(self, goal: FollowJointTrajectoryGoal, moment: Moment) -> Iterator[None]:
        """Checks ahead, in pieces, what `accept` finds done then; it decides the same without."""
        start = None
        if self._is_next(goal) or not self._device.refusal(moment, self._controller.comes_to_rest()):
            start = self._start_of(goal, moment).start
        yield from self._validator.prepare(goal, start, self._device.parameters)

    def accept(self, goal_id: str, goal: FollowJointTrajectoryGoal, moment: Moment) -> GoalVerdict:
        """Accept and start a goal, or say why not."""
        controller = self._controller
        if reason := self._device.refusal(moment, controller.comes_to_rest()):
            return GoalVerdict.refused(FollowErrorCode.DEVICE_FAILED, reason)
        try:
            if self._current is not None and self._current.ending is not None:
                raise invalid(because("goal.decelerating", remedy("wait_for_rest")))
            self.scenes.require_newest(PlannedIn.of(goal))
            hold = self._start_of(goal, moment).start.position
            checked = self._validator.check(goal, moment.unix, self._device.parameters, hold)
            checked = checked.with_more_time(self._device.settling_time)
            if goal.after and (present := self._next.require_place(checked, self._current, goal.after)) is not None:
                return self._accept_next(goal_id, checked, present, moment)
            motion_start = controller.motion_start(moment)
            path = self._validator.path(checked, motion_start, moment.unix, self._device.parameters)
        except GoalRejected as rejected:
            return GoalVerdict.refused(rejected.code, rejected.reason)
        self._drop_waiting(moment)
        self._waiting = ActiveGoal(goal_id, checked, self._device.joints, moment)
        if checked.trajectory.stamp <= moment.unix:
            self._waiting.accepted_from = motion_start
        self._start_waiting(moment, path)
        return GoalVerdict(True)

    def _is_next(self, goal: FollowJointTrajectoryGoal) -> bool:
        """True if it is to begin where the present one ends."""
        return bool(goal.after) and self._current is not None

    def _start_of(self, goal: FollowJointTrajectoryGoal, moment: Moment) -> MotionStart:
        """From where its path would begin."""
        if goal.after and self._current is not None:
            return NextGoal.start_of(self._current)
        return self._controller.motion_start(moment)

    def cancel(self, goal_id: str, moment: Moment) -> Reason | None:
        """Decelerate; None, or why there is nothing to cancel."""
        if self._next.goal is not None and self._next.goal.goal_id == goal_id:
            if (taken := self._next.cancel()) is not None:
                self._finish(taken, CANCELED, moment)
            return None
        execution = next((e for e in (self._current, self._waiting) if e is not None and e.goal_id == goal_id), None)
        if execution is None:
            return because("goal.not_under_way", goal=goal_id)
        if execution is self._waiting:
            self._waiting = None
            if self._current is not None or self._controller.is_resting():
                self._finish(execution, CANCELED, moment)
                return None
            self._current = execution  # what it waited behind has to stop
        self._end(CANCELED, moment)
        return None

    def step(self, moment: Moment, period: float) -> None:
        """Start what has waited, and end what is late or refused; `period` [s] since the last step."""
        self._start_waiting(moment)
        self._require_scene_of_next(moment)
        execution, controller = self._current, self._controller
        if execution is None:
            return self._stop_what_failed(moment)
        if execution.ending is not None:
            if controller.has_stopped():
                self._finish_current(execution.ending, moment)
            elif controller.is_unheard(moment):
                controller.lost()
                before = () if execution.ending.reason is None else (execution.ending.reason,)
                unanswered = because("ending.stop_unanswered", *before)
                self._finish_current(execution.ending._replace(reason=unanswered), moment)
            return
        stream = execution.stream
        if stream is not None and stream.failure is not None:
            return self._end(GoalEnding(*FAILED, stream.failure), moment)
        if execution.deadline is not None:
            execution.deadline += period * controller.slowdown_share
            if moment.monotonic > execution.deadline and self._device.state is not None:
                self._end(execution.late(self._device.state, moment.monotonic), moment)

    def on_ack(self) -> None:
        """EXECUTING means that the device has taken knots of the goal."""
        execution = self._current
        if execution is None or execution.is_executing or execution.stream is None or execution.ending is not None:
            return
        if execution.stream.acked > execution.first_seq:
            execution.is_executing = True
            self._device.out.put(GoalExecuting(execution.goal_id))

    def on_state(self, state: StateFrame, point: PathPoint, moment: Moment) -> None:
        """Check the goal's tolerances, report progress, and see whether it is done.

        `point` is the path [steps] at the instant of `state`.
        """
        execution, controller = self._current, self._controller
        if execution is not None and execution.stream is not None and state.stream == execution.stream.id:
            self._follow(execution, state, point, moment)
        if controller.is_resting():
            self._start_waiting(moment)

    def abort(self, reason: Reason, moment: Moment) -> None:
        """The device can no longer be relied upon: end now, with the last steps known."""
        self._drop_waiting(moment, GoalEnding(*FAILED, reason))
        self._controller.transmission.abandon()
        if self._current is not None:
            ending = self._current.ending
            if ending is not None and ending.reason is not None:
                reason = because("ending.then", ending.reason, reason)
            self._finish_current(GoalEnding(*FAILED, reason), moment)

    def stop(self, reason: Reason, moment: Moment) -> None:
        """Decelerate and abort, for a reason outside the goal."""
        self._drop_waiting(moment, GoalEnding(*FAILED, reason))
        if self._current is None:
            self._controller.stop(moment)
        self._end(GoalEnding(*FAILED, reason), moment)

    def on_hold(self, moment: Moment) -> None:
        """The device holds by itself on a path of ours."""
        stream, cause = self._controller.held
        is_this = self._controller.stream is not None and stream == self._controller.stream.id
        reason = because(HELD.get(cause, HELD_SILENTLY) if is_this else HELD_SILENTLY)
        if self._current is None:
            self.stop(reason, moment)
        self._end(GoalEnding(*FAILED, reason), moment)

    def on_foreign_motion(self, moment: Moment) -> None:
        """The device played another stream than the present goal's, and is being stopped."""
        self._end(GoalEnding(*FAILED, because("ending.other_stream")), moment)

    def _accept_next(self, goal_id: str, checked: ValidatedGoal, present: ActiveGoal, moment: Moment) -> GoalVerdict:
        """The goal begins at the end of the present one; raises `GoalRejected`."""
        path = self._validator.path(checked, NextGoal.start_of(present), moment.unix, self._device.parameters)
        self._drop_waiting(moment)
        self._next.put(ActiveGoal(goal_id, checked, self._device.joints, moment), path, present)
        return GoalVerdict(True)

    def _require_scene_of_next(self, moment: Moment) -> None:
        """What follows was planned in a scene that may be another by now; knots on their way are not called back."""
        if (goal := self._next.withdrawable) is None:
            return
        try:
            self.scenes.require_newest(goal.goal.planned_in)
        except GoalRejected as rejected:
            self._next.take_away()
            self._finish(goal, GoalEnding(GoalStatusCode.ABORTED, rejected.code, rejected.reason), moment)

    def _follow(self, execution: ActiveGoal, state: StateFrame, point: PathPoint, moment: Moment) -> None:
        strayed = execution.follow(point, state)
        stream = execution.stream
        if execution.ending is None and strayed is None and self._next.is_due(execution, state):
            return self._go_on_to_next(execution, state, point, moment)
        is_finished = stream is not None and stream.is_finished and execution.ending is None
        if is_finished and strayed is None and execution.is_reached(state):
            return self._finish_current(SUCCEEDED, moment)
        if is_finished and execution.deadline is None:  # no time would bring more steps
            return self._finish_current(strayed or execution.late(state, moment.monotonic), moment)
        if strayed is not None and execution.ending is None:
            return self._end(strayed, moment)
        self._report(execution, state, point, moment)

    def _go_on_to_next(self, execution: ActiveGoal, state: StateFrame, point: PathPoint, moment: Moment) -> None:
        """The arm has passed the end of the present goal on its way to that of the next."""
        execution.is_passed = True
        if (missed := execution.passing_error(point, state)) is not None:
            return self._end(missed, moment)
        following = self._next.begin(state, moment)
        self._finish_current(SUCCEEDED, moment)
        self._current, ending, following.ending = following, following.ending, None
        self._device.out.put(GoalExecuting(following.goal_id))
        if ending is not None:  # it was cancelled when its knots were on their way
            self._end(ending, moment)

    def _report(self, execution: ActiveGoal, state: StateFrame, point: PathPoint, moment: Moment) -> None:
        if moment.monotonic < execution.feedback_due or not execution.is_executing:
            return
        period = 1.0 / self._device.parameters.feedback_rate
        execution.feedback_due = next_beat(execution.feedback_due, moment.monotonic, period)
        positions = (self._device.reporter.positions(point.steps), self._device.reporter.positions(state.steps))
        feedback = execution.feedback(point, state, positions, moment.unix)
        self._device.out.put(GoalProgress(execution.goal_id, feedback))

    def _start_waiting(self, moment: Moment, path: TimedPath | None = None) -> None:
        """Begin the goal that waits if its time has come; `path` is known if it was accepted this very moment."""
        execution, controller = self._waiting, self._controller
        if execution is None or execution.goal.trajectory.stamp > moment.unix:
            return
        if self._current is not None and self._current.ending is not None:
            return
        if not (controller.transmission.is_open or controller.is_resting()):
            self._preempt(moment)
            return
        motion_start = controller.motion_start(moment)
        if execution.accepted_from is not None:
            motion_start = motion_start.joined(execution.accepted_from)
        self._waiting = None
        try:
            self.scenes.require_newest(execution.goal.planned_in)
            path = path or self._validator.path(execution.goal, motion_start, moment.unix, self._device.parameters)
        except GoalRejected as rejected:
            ending = GoalEnding(GoalStatusCode.ABORTED, rejected.code, rejected.reason)
            return self._finish(execution, ending, moment)
        self._preempt(moment)
        self._begin(execution, PathKnots(path), moment)

    def _begin(self, execution: ActiveGoal, motion: PathKnots, moment: Moment) -> None:
        controller = self._controller
        controller.lead = self._device.parameters.trajectory_lead
        self._current = execution
        execution.departed = () if self._device.state is None else self._device.state.steps
        stream = controller.stream
        ahead = 0.0
        if stream is not None and controller.transmission.is_open:
            start_us, execution.first_seq = stream.end_us, stream.next_seq
            ahead = (start_us - stream.played_us(moment.monotonic, self._device.session.clock)) * 1e-6
            controller.transmission.splice(motion)
            controller.pump(moment)
        else:
            start_us = 0
            stream = controller.begin(motion, motion.start, moment)
        late = execution.goal.time_tolerance
        end = moment.monotonic + ahead + motion.duration_us * 1e-6
        execution.begin(stream, start_us, motion.duration_us, None if late is None else end + late)

    def _stop_what_failed(self, moment: Moment) -> None:
        """The motion that a goal waits behind must come to an end."""
        controller = self._controller
        stream = controller.stream if controller.transmission.owns_motion else None
        if self._waiting is not None and stream is not None and stream.failure is not None:
            controller.stop(moment)

    def _preempt(self, moment: Moment) -> None:
        if self._current is not None:
            self._finish_current(GoalEnding(*PREEMPTED, because("ending.preempted")), moment)

    def _drop_waiting(self, moment: Moment, ending: GoalEnding | None = None) -> None:
        execution, self._waiting = self._waiting, None
        if execution is not None:
            never_began = GoalEnding(*PREEMPTED, because("ending.preempted.never_began"))
            self._finish(execution, ending or never_began, moment)

    def _end(self, ending: GoalEnding, moment: Moment) -> None:
        """Decelerate; the goal ends once the arm stands."""
        if self._current is not None and self._current.ending is None:
            self._current.ending = ending
            self._controller.stop(moment)
            self._drop_next(self._current, ending, moment)

    def _finish_current(self, ending: GoalEnding, moment: Moment) -> None:
        execution, self._current = self._current, None
        if execution is None:
            return
        self._finish(execution, ending, moment)
        if ending.status is not GoalStatusCode.SUCCEEDED:
            self._drop_next(execution, ending, moment)
        elif (waiting := self._next.take_away()) is not None:
            self._waiting = waiting  # its knots could not follow in the stream any more: it begins at rest

    def _drop_next(self, present: ActiveGoal, ending: GoalEnding, moment: Moment) -> None:
        """What was to follow does not."""
        if (dropped := self._next.take_away()) is not None:
            before = () if ending.reason is None else (ending.reason,)
            reason = because("ending.before_it", *before, goal=present.goal_id, status=ending.status.name)
            self._finish(dropped, GoalEnding(GoalStatusCode.ABORTED, ending.code, reason), moment)

    def _finish(self, execution: ActiveGoal, ending: GoalEnding, moment: Moment) -> None:
        is_open_loop = self._device.session.is_open_loop
        if is_open_loop:
            ending = ending._replace(reason=_not_verified(ending.reason))
        result = execution.result(ending, self._device.state, moment.monotonic)
        result = as_not_verified(result) if is_open_loop else result
        self._device.out.put(GoalFinished(execution.goal_id, ending.status, result))
        self._next.ended(execution.goal_id, ending.status)
        level = LogLevel.INFO if ending.status == GoalStatusCode.SUCCEEDED else LogLevel.WARNING
        self._device.out.log(level, execution.account(ending, self._device.state, moment.monotonic))


def _not_verified(ended: Reason | None) -> Reason:
    """Of a board that does not say what it has executed: `ended` is why the goal ended before its end."""
    return because("ending.not_verified") if ended is None else because("ending.ended_not_verified", ended)
