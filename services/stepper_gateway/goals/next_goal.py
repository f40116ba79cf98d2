"""The goal that begins where and when the present one ends: its knots follow in the same stream, without a pause."""

from __future__ import annotations

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.reasons import because, remedy
from gemelo.services.stepper_gateway.goals.active_goal import ActiveGoal, GoalEnding
from gemelo.services.stepper_gateway.goals.goal_validator import MotionStart, ValidatedGoal
from gemelo.services.stepper_gateway.goals.rejections import invalid
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.knot_sources import PathKnots
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.paths import TimedPath

CANCELED = GoalEnding(GoalStatusCode.CANCELED, FollowErrorCode.CANCELED, because("ending.canceled"))


class NextGoal:
    """At most one goal that waits behind the present one."""

    def __init__(self, controller: MotionController) -> None:
        self._controller = controller
        self.goal: ActiveGoal | None = None
        self._last: tuple[str, GoalStatusCode] = ("", GoalStatusCode.UNKNOWN)  # the goal that has ended last

    def ended(self, goal_id: str, status: GoalStatusCode) -> None:
        """A goal has ended: one that was to follow it may come a moment too late."""
        self._last = goal_id, status

    def require_place(self, checked: ValidatedGoal, present: ActiveGoal | None, after: str) -> ActiveGoal | None:
        """The goal that it is to follow, None if that one has just succeeded; raises `GoalRejected`."""
        if checked.trajectory.stamp:
            raise invalid(because("goal.after.stamp", goal=after))
        if present is None and self._last == (after, GoalStatusCode.SUCCEEDED):
            return None
        if present is None or present.goal_id != after:
            anew = remedy("plan_from_here")
            if self._last[0] == after:
                raise invalid(because("goal.after.ended", anew, goal=after, status=self._last[1].name))
            raise invalid(because("goal.after.not_under_way", anew, goal=after))
        if self.goal is not None:
            raise invalid(because("goal.after.taken", goal=self.goal.goal_id, before=after))
        return present

    @staticmethod
    def start_of(present: ActiveGoal) -> MotionStart:
        """The end of the present goal, exactly."""
        end = present.goal.target
        return MotionStart(Knot.at_rest(end), end, end, is_sent=True)

    def put(self, execution: ActiveGoal, path: TimedPath, present: ActiveGoal) -> None:
        """Let it follow: in the stream where knots can still be added, else as soon as the arm rests."""
        self.goal = execution
        transmission, stream = self._controller.transmission, present.stream
        if stream is not None and transmission.is_open and stream is transmission.stream:
            motion = PathKnots(path)
            transmission.follow(motion)
            execution.begin(stream, present.end_us, motion.duration_us, None)

    @property
    def withdrawable(self) -> ActiveGoal | None:
        """The goal, while none of its knots is on its way."""
        goal = self.goal
        is_sent = goal is not None and goal.stream is not None and not self._controller.transmission.has_following
        return None if is_sent else goal

    def cancel(self) -> ActiveGoal | None:
        """Take the goal away where that can be done; else it ends as soon as it begins."""
        if self.withdrawable is not None:
            return self.take_away()
        if self.goal is not None:
            self.goal.ending = CANCELED
        return None

    def take_away(self) -> ActiveGoal | None:
        """The goal, which will not follow any more."""
        goal, self.goal = self.goal, None
        if goal is not None and goal.stream is not None:
            self._controller.transmission.follow(None)
        return goal

    def is_due(self, present: ActiveGoal, state: StateFrame) -> bool:
        """True if the arm has passed the end of the present goal, and is on the way to this one's."""
        return self.goal is not None and self.goal.stream is not None and state.play_us >= present.end_us

    def begin(self, state: StateFrame, moment: Moment) -> ActiveGoal:
        """It is the present goal from now on, and executing."""
        goal, self.goal = self.goal, None
        assert goal is not None
        goal.departed, goal.is_executing = state.steps, True
        late = goal.goal.time_tolerance
        goal.deadline = None if late is None else moment.monotonic + (goal.end_us - state.play_us) * 1e-6 + late
        return goal
