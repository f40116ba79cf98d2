"""Carries out `gripper_command`: one goal at a time, until the jaws are there or something keeps them."""

from __future__ import annotations

from dataclasses import dataclass

from gemelo.libraries.arm.model.gripper import METRES
from gemelo.libraries.arm.model.jaws import gripper_unit, opening_sensor
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandResponse, DeviceMode
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult, GripperState
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import GRIPPER_STATE
from gemelo.services.stepper_gateway.device.command_handler import CommandHandler, OnAnswer
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.goals.goal_executor import GoalVerdict
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected, invalid
from gemelo.services.stepper_gateway.gripper.jaws import Jaws, jaws_of
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.links.reports import SensorReport
from gemelo.services.stepper_gateway.moment import Moment, next_beat
from gemelo.services.stepper_gateway.outputs import GripperExecuting, GripperFinished, GripperProgress

PERIOD = 0.1  # [s] between two states, and between two feedbacks; chosen: smooth for a person's eye
FRESH = 1.0  # [s] that a reading of the jaws counts; chosen: ten of them
STALL_TIME = 0.35  # [s] without movement that count as stalled; chosen: three readings
STILL = 0.0003  # [m] that a reading may waver at rest; chosen: a hundredth of a servo's stroke is noise
PATIENCE = 3.0  # [s] beyond the travel time until a goal is given up; chosen: a servo under load is slower


@dataclass
class ActiveGrip:
    """A goal under way; times in [s] monotonic."""

    goal_id: str
    position: float  # [m]
    began: float
    arrival: float  # when it may be there at the earliest
    deadline: float
    answered: float | None = None  # when the device has taken the command
    still_at: float = 0.0  # [m] the last place that it has left
    still_since: float = 0.0
    feedback_due: float = 0.0


class GripperExecutor:
    """The gripper of one device."""

    def __init__(self, device: GatewayDevice, commands: CommandHandler) -> None:
        self._device, self._commands = device, commands
        self._gripper = device.arm.gripper
        self._jaws: Jaws | None = jaws_of(device.arm)
        self._metres = METRES[gripper_unit(device.arm)]  # [m] of the sensor's unit
        self._sensor = opening_sensor(device.arm)
        self._reading, self._read = 0.0, -1e9  # [m], [s] monotonic
        self._grip: ActiveGrip | None = None
        self._stalled = False
        self._due = 0.0  # [s] monotonic, of the next state

    @property
    def is_active(self) -> bool:
        return self._grip is not None

    def accept(self, goal_id: str, goal: GripperCommandGoal, moment: Moment) -> GoalVerdict:
        """Accept and start a goal, or say why not."""
        try:
            jaws = self._require(goal, moment)
        except GoalRejected as rejected:
            return GoalVerdict.refused(rejected.code, rejected.reason)
        self._end(GoalStatusCode.PREEMPTED, because("ending.preempted"), moment)
        now = moment.monotonic
        arrival = now + jaws.travel_time(goal.position)
        self._stalled = False
        self._grip = ActiveGrip(goal_id, goal.position, now, arrival, arrival + PATIENCE)
        self._commands.have_sent(*jaws.sending(goal.position), self._answer_to(goal_id), moment)
        return GoalVerdict(True)

    def cancel(self, goal_id: str, moment: Moment) -> Reason | None:
        """Let the jaws stay where they are; None, or why there is nothing to cancel."""
        if self._grip is None or self._grip.goal_id != goal_id:
            return because("goal.not_under_way", goal=goal_id)
        self._keep_jaws(moment)
        self._end(GoalStatusCode.CANCELED, because("gripper.canceled"), moment)
        return None

    def stop(self, reason: Reason, moment: Moment) -> None:
        """Let the jaws stay where they are, and abort what was under way."""
        if self._grip is not None:
            self._keep_jaws(moment)
            self._end(GoalStatusCode.ABORTED, reason, moment)

    def abort(self, reason: Reason, moment: Moment) -> None:
        """What was under way is not watched any more."""
        self._end(GoalStatusCode.ABORTED, reason, moment)

    def on_state(self, state: StateFrame, moment: Moment) -> None:
        """The device has said how its outputs and its servo are."""
        if self._jaws is None:
            return
        self._jaws.on_state(state, moment.monotonic)
        grip = self._grip
        if grip is None:
            return
        if state.mode == DeviceMode.ESTOP:
            return self._end(GoalStatusCode.ABORTED, because("gripper.estop"), moment)
        if grip.answered is not None and self._jaws.is_overruled(grip.position):
            self._end(GoalStatusCode.ABORTED, because("gripper.overruled"), moment)

    def on_readings(self, report: SensorReport, arrival: float) -> None:
        """What the board has measured; `arrival` [s] monotonic."""
        if self._sensor in report.values:
            self._reading, self._read = report.values[self._sensor] * self._metres, arrival

    def step(self, moment: Moment) -> None:
        """See whether the goal is over, and tell of the jaws."""
        if self._jaws is None:
            return
        if self._grip is not None:
            self._follow(self._grip, self._jaws, moment)
        if moment.monotonic >= self._due and not self._device.unreachable_reason(moment):
            self._due = next_beat(self._due, moment.monotonic, PERIOD)
            self._device.publish(GRIPPER_STATE, self._state(self._jaws, moment), moment)

    def _keep_jaws(self, moment: Moment) -> None:
        sending = self._jaws.stopping() if self._jaws is not None else None
        if sending is not None:
            self._commands.have_sent(*sending, None, moment)

    def _require(self, goal: GripperCommandGoal, moment: Moment) -> Jaws:
        if self._jaws is None or self._gripper is None:
            raise invalid(because("gripper.none", robot=self._device.arm.name))
        if reason := self._device.unreachable_reason(moment) or self._device.configuration.mismatch_reason():
            raise GoalRejected(FollowErrorCode.DEVICE_FAILED, reason)
        state = self._device.state
        if state is None:
            unknown = because("device.joints_unknown", device=self._device.arm.device.name)
            raise GoalRejected(FollowErrorCode.DEVICE_FAILED, unknown)
        if state.mode == DeviceMode.ESTOP:
            raise GoalRejected(FollowErrorCode.DEVICE_FAILED, because("gripper.refused.estop"))
        self._jaws.require(goal.position)
        if goal.max_effort < 0.0:
            raise invalid(because("gripper.effort.negative", value=goal.max_effort))
        if 0.0 < goal.max_effort < self._gripper.effort:
            effort = self._gripper.effort
            raise invalid(because("gripper.effort.too_small", value=goal.max_effort, effort=effort))
        return self._jaws

    def _answer_to(self, goal_id: str) -> OnAnswer:
        def on_answer(answer: DeviceCommandResponse, moment: Moment) -> None:
            grip = self._grip
            if grip is None or grip.goal_id != goal_id:
                return
            if not answer.accepted:
                return self._end(GoalStatusCode.ABORTED, answer.why, moment)
            grip.arrival += moment.monotonic - grip.began
            grip.answered = grip.still_since = moment.monotonic
            grip.still_at = self._position(moment)
            self._device.out.put(GripperExecuting(goal_id))

        return on_answer

    def _follow(self, grip: ActiveGrip, jaws: Jaws, moment: Moment) -> None:
        now, position = moment.monotonic, self._position(moment)
        if grip.answered is not None:
            if abs(position - grip.still_at) > STILL:
                grip.still_at, grip.still_since = position, now
            if self._is_there(grip, jaws, moment):
                return self._end(GoalStatusCode.SUCCEEDED, None, moment, reached=True)
            if self._is_stalled(grip, jaws, moment):
                self._stalled = True
                return self._end(GoalStatusCode.SUCCEEDED, None, moment)
        if now >= grip.deadline:
            late = because("gripper.not_arrived", position=position, time=now - grip.began)
            return self._end(GoalStatusCode.ABORTED, late, moment)
        if grip.answered is not None and now >= grip.feedback_due:
            grip.feedback_due = next_beat(grip.feedback_due, now, PERIOD)
            feedback = GripperCommandFeedback(stamp=moment.unix, position=position, effort=self._effort(moment))
            self._device.out.put(GripperProgress(grip.goal_id, feedback))

    def _is_there(self, grip: ActiveGrip, jaws: Jaws, moment: Moment) -> bool:
        if not jaws.has_arrived or self._gripper is None:
            return False
        if not self._is_measured(moment):
            return moment.monotonic >= grip.arrival
        return abs(self._reading - grip.position) <= self._gripper.tolerance

    def _is_stalled(self, grip: ActiveGrip, jaws: Jaws, moment: Moment) -> bool:
        """The pulse is there, the jaws are not, and do not come nearer."""
        is_still = moment.monotonic - grip.still_since >= STALL_TIME
        return jaws.has_arrived and is_still and self._is_measured(moment)

    def _is_measured(self, moment: Moment) -> bool:
        return bool(self._sensor) and moment.monotonic - self._read <= FRESH

    def _position(self, moment: Moment) -> float:
        """[m] as measured, else as commanded, else the goal's."""
        if self._is_measured(moment):
            return self._reading
        if self._jaws is not None and self._jaws.commanded is not None:
            return self._jaws.commanded
        return self._grip.position if self._grip is not None else 0.0

    def _effort(self, moment: Moment) -> float:
        """[N] by the data sheet, while it presses; one that is not measured presses when it is closed."""
        jaws, gripper = self._jaws, self._gripper
        if jaws is None or gripper is None:
            return 0.0
        is_shut = not self._is_measured(moment) and jaws.commanded == gripper.closed
        return gripper.effort if self._stalled or is_shut else 0.0

    def _state(self, jaws: Jaws, moment: Moment) -> GripperState:
        position = self._position(moment)
        target = jaws.target if jaws.target is not None else position
        return GripperState(
            stamp=moment.unix,
            known=self._is_measured(moment) or jaws.commanded is not None,
            measured=self._is_measured(moment),
            position=position,
            target=target,
            moving=self._grip is not None or (jaws.commanded is not None and jaws.commanded != target),
            stalled=self._stalled,
            effort=self._effort(moment),
        )

    def _end(self, status: GoalStatusCode, reason: Reason | None, moment: Moment, reached: bool = False) -> None:
        grip = self._grip
        if grip is None:
            return
        position = self._position(moment)
        result = GripperCommandResult(
            position=position,
            effort=self._effort(moment),
            stalled=self._stalled,
            reached_goal=reached,
            measured=self._is_measured(moment),
            error_string=str(reason or ""),
            why=reason,
        )
        self._grip = None
        self._device.out.put(GripperFinished(grip.goal_id, status, result))
        level = LogLevel.INFO if status is GoalStatusCode.SUCCEEDED else LogLevel.WARNING
        became = str(reason or "") or ("stalled" if self._stalled else "is there")
        wanted = f"gripper to {grip.position * 1000:g} mm"
        self._device.out.log(level, f"{wanted}: {became}, at {position * 1000:.1f} mm")
        self._due = 0.0  # the state is told at once
