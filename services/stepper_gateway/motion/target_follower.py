"""Streamed joint targets: tracked while nothing else moves the arm, stopped when they fall silent.

Whoever streams must go on sending (0.5 s by default), also to keep a far target: the arm does not go on to a stale one.
A device that takes replacements follows them by these, at every target's arrival; another one by a queue of knots.
"""

from __future__ import annotations

from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import StreamVerdict
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected, invalid
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.live_targets import LiveTargets
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.target_stream import TargetStream

COMPLAINT = 1.0  # [s] between two of them; chosen: the log stays readable


class TargetFollower:
    """Feeds targets to the controller."""

    def __init__(self, device: GatewayDevice, controller: MotionController) -> None:
        self._device, self._controller = device, controller
        self._targets = TargetStream(device.joints)
        self._live = LiveTargets(device, controller)
        self._complained = self._obstructed = -1.0e9  # [s] monotonic, of the newest event of each kind
        self._unsaid = 0

    def on_targets(
        self, targets: JointTargets, goal_is_active: bool, moment: Moment, was_watched: bool = False
    ) -> None:
        """Take the newest target, or refuse it and keep the one before; `was_watched`: the planner has looked at its
        way already."""
        silence = self._device.parameters.stream_silence
        self._targets.note_message(targets, moment.monotonic, silence)
        try:
            if goal_is_active:
                raise invalid(because("target.goal_active"))
            if reason := self._device.refusal(moment):
                raise invalid(reason)
            self._targets.require_uninterrupted(silence)
            columns = self._targets.checked(targets)
        except GoalRejected as rejected:
            return self._complain(rejected.reason, moment)
        if self._device.replaces_paths:
            return self._live.take(targets, columns, moment, was_watched)
        self._targets.take(columns, self._present(moment))
        self._targets.plan(targets, tuple(columns), moment.monotonic)
        self._begin(moment)

    def step(self, moment: Moment) -> None:
        """Brake on silence, begin when the arm rests, notice the end."""
        for columns in self._targets.due(moment.monotonic):
            self._targets.take(columns, self._present(moment))
        is_silent = self._targets.is_silent(moment.monotonic, self._device.parameters.stream_silence)
        failure = self._live.step(is_silent, moment)
        if failure is not None:
            self._targets.interrupt()
            self._complain(failure, moment)
            if self._controller.is_followable:
                self._controller.stop(moment)
        if (complaint := self._live.take_complaint()) is not None:
            self._complain(complaint, moment)
        obstruction = self._live.take_obstruction()
        if obstruction is not None and moment.monotonic - self._obstructed >= COMPLAINT:
            self._obstructed = moment.monotonic
            self._device.event("target_obstructed", obstruction, moment)
        stream = self._controller.stream
        if self._targets.is_active and (stream is None or not self._controller.transmission.is_open):
            self._end(None if stream is None else stream.failure, moment)
        if is_silent:
            self._fall_silent(moment)
        self._begin(moment)

    def on_verdict(self, verdict: StreamVerdict, moment: Moment) -> None:
        """The planner has looked at the way of the newest targets."""
        self._live.on_verdict(verdict, moment)

    def on_ack(self, moment: Moment) -> None:
        """The device has answered a chunk: what it has not taken is sent anew."""
        self._live.send_due(moment)

    def end_for_goal(self) -> None:
        """A goal takes over from where the targets have led."""
        self._targets.end()
        self._live.end()

    def interrupt(self) -> None:
        """The arm is stopped for another reason; targets count again after a silence."""
        self._targets.end(interrupted=True)
        if self._live.is_followed:
            self._targets.interrupt()
            self._live.drop()

    @property
    def is_active(self) -> bool:
        return self._targets.is_active or self._live.is_active

    def _present(self, moment: Moment) -> Vector:
        return self._controller.motion_start(moment).start.position

    def _fall_silent(self, moment: Moment) -> None:
        """Decelerate now, not behind what has been sent; a stream that rests ends with its last knot."""
        if self._targets.is_active and not self._targets.is_resting:
            self._controller.stop(moment, is_silence=True)
            self._targets.end()
        self._targets.fall_silent()

    def _begin(self, moment: Moment) -> None:
        controller = self._controller
        if self._targets.target is None or self._targets.is_active or not controller.is_resting():
            return
        start = controller.motion_start(moment).start
        controller.lead = self._device.parameters.streaming_lead
        controller.begin(self._targets.motion(start), start.position, moment)

    def _end(self, failure: Reason | None, moment: Moment) -> None:
        if failure is not None:
            self._fail(failure, moment)
        self._targets.end(interrupted=failure is not None)

    def _fail(self, failure: Reason, moment: Moment) -> None:
        self._complain(failure, moment)
        self._controller.stop(moment)

    def _complain(self, reason: Reason, moment: Moment) -> None:
        """Once a second at most: targets come fast."""
        if moment.monotonic - self._complained < COMPLAINT:
            self._unsaid += 1
            return
        about = because("target.and_more", reason, count=self._unsaid) if self._unsaid else reason
        self._complained, self._unsaid = moment.monotonic, 0
        self._device.event("target_refused", about, moment)
