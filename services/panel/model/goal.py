"""The goal arm: joint values that sliders, a gizmo or names lead, checked all the time, the newest wish first."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import acos, dist, pi

import gemelo
from gemelo.services.panel.model.problems import Problem, problem_of
from gemelo.services.panel.model.tool_turns import tool_turns

IDLE = 1.0  # [s] after which a solver without work looks whether it is to end
FOUND = 1.0  # [s] in which a goal is mostly found; a plan waits no longer: somebody else may drag it all the time
JUMP = {"rad": pi / 4, "m": 0.05}  # chosen: more of a joint between two points of a drag is another configuration
FAR, TURNED = 0.1, pi / 4  # [m], [rad] chosen: to a goal so far away, as by a click, the joints go far in any case


@dataclass(frozen=True)
class GoalState:
    """Where the arm is to go, and what is wrong with that; `problem` is of `joints`, or of `wanted`."""

    joints: Mapping[str, float]  # [rad] or [m]
    pose: gemelo.Pose  # of the tool at `joints`
    problem: Problem | None = None
    wanted: gemelo.Pose | None = None  # where the gizmo was dragged, if the arm cannot be there
    jumped: tuple[str, ...] = ()  # joints that the last step of a drag has thrown to another configuration
    version: int = 0
    source: int = -1  # the browser that set it


@dataclass(frozen=True)
class JointsWish:
    joints: Mapping[str, float]
    source: int


@dataclass(frozen=True)
class PoseWish:
    pose: gemelo.Pose
    source: int
    is_turned: bool  # the orientation is meant too


class GoalSolver:
    """Turns wishes into goals in a thread of its own; of wishes that come faster than answers only the newest counts.

    `on_change` is called from that thread after every change.
    """

    def __init__(self, arm: gemelo.Arm, on_change: Callable[[], object]) -> None:
        self._arm, self._on_change = arm, on_change
        self._news = threading.Condition()
        self._wish: JointsWish | PoseWish | None = None
        self._pose_wish: PoseWish | None = None  # the last one
        self._is_open, self._is_solving, self._is_stale = True, False, False
        self.turns = tool_turns(arm.description)  # what the gizmo offers
        self.solved = 0  # wishes that were answered
        joints = arm.joints
        self.goal = GoalState(joints, arm.fk(joints))
        self._thread = threading.Thread(target=self._run, name="goal", daemon=True)
        self._thread.start()

    def set_joints(self, joints: Mapping[str, float], source: int = -1) -> None:
        """All joints [rad] or [m], or some; the goal shows them at once, and is checked right after."""
        with self._news:
            joints = {**self.goal.joints, **joints}
            self.goal = replace(self.goal, joints=joints, version=self.goal.version + 1, source=source)
            self._want(JointsWish(joints, source))

    def set_pose(self, pose: gemelo.Pose, source: int = -1, *, is_turned: bool = False) -> None:
        """Where the tool is to be; the nearest configuration is taken.

        Its orientation counts where it was turned, or where the arm can keep it; else it follows from the place.
        """
        with self._news:
            keeps = any(self.turns.rings) and self.turns.keeps_orientation
            self._pose_wish = PoseWish(pose, source, is_turned or keeps)
            self._want(self._pose_wish)

    def settle(self) -> None:
        """The drag has ended: the gizmo goes back to where the goal arm's tool is."""
        with self._news:
            if self._wish is None and self.goal.wanted is not None:
                self.goal = replace(self.goal, wanted=None, version=self.goal.version + 1)
        self._on_change()

    def wait(self, timeout: float = FOUND) -> bool:
        """Until `goal` is that of the last wish; False where one is not found after `timeout` [s]."""
        with self._news:
            return self._news.wait_for(lambda: not (self._has_work or self._is_solving), timeout)

    def check_again(self) -> None:
        """What stands around has changed; what is wished meanwhile stays."""
        with self._news:
            self._is_stale = True
            self._news.notify_all()

    def close(self) -> None:
        """Ends the thread."""
        with self._news:
            self._is_open = False
            self._news.notify_all()
        self._thread.join(2.0)

    @property
    def _has_work(self) -> bool:
        return self._wish is not None or self._is_stale

    def _want(self, wish: JointsWish | PoseWish) -> None:
        self._wish = wish
        self._news.notify_all()

    def _run(self) -> None:
        while True:
            with self._news:
                while self._is_open and not self._has_work:
                    self._news.wait(IDLE)
                if not self._is_open:
                    return
                before = self.goal
                wish = self._wish or self._standing_wish(before)
                self._wish, self._is_stale, self._is_solving = None, False, True
            goal = self._checked(before, wish) if isinstance(wish, JointsWish) else self._followed(before, wish)
            with self._news:
                self.solved += 1
                if not isinstance(self._wish, JointsWish):  # sliders have gone on meanwhile: theirs stay
                    self.goal = replace(goal, version=self.goal.version + 1, source=wish.source)
                self._is_solving = False
                self._news.notify_all()
            self._on_change()

    def _standing_wish(self, goal: GoalState) -> JointsWish | PoseWish:
        """What `goal` is of: where it could not follow the gizmo, the gizmo's pose."""
        if goal.wanted is not None and self._pose_wish is not None:
            return self._pose_wish
        return JointsWish(goal.joints, goal.source)

    def _checked(self, before: GoalState, wish: JointsWish) -> GoalState:
        """The configuration of the sliders, which is shown also where it cannot be."""
        try:
            pose = self._arm.fk(wish.joints)
        except Exception as error:
            return replace(before, problem=problem_of(error))
        return GoalState(wish.joints, pose, self._problem_at(wish.joints))

    def _followed(self, before: GoalState, wish: PoseWish) -> GoalState:
        """The nearest configuration for the gizmo's pose; where there is none, the goal stays and says why."""
        target = self._target(wish)
        try:
            [joints] = self._arm.ik(near=before.joints, **target)
            return self._arrived(before, joints, wish, None)
        except gemelo.Refused as refused:
            problem = problem_of(refused)
        except Exception as error:
            return replace(before, problem=problem_of(error), wanted=wish.pose)
        if problem.check not in ("collision", "self-collision"):
            return replace(before, problem=problem, wanted=wish.pose, jumped=())
        try:
            [joints] = self._arm.ik(near=before.joints, touching=True, **target)
        except Exception:
            return replace(before, problem=problem, wanted=wish.pose, jumped=())
        return self._arrived(before, joints, wish, self._problem_at(joints) or problem)

    def _arrived(
        self, before: GoalState, joints: Mapping[str, float], wish: PoseWish, problem: Problem | None
    ) -> GoalState:
        units = {joint.name: joint.unit for joint in self._arm.description.joints}
        is_far = dist(before.pose.position, wish.pose.position) > FAR or (
            wish.is_turned and _angle(before.pose, wish.pose) > TURNED
        )
        jumped = [name for name, at in joints.items() if abs(at - before.joints[name]) > JUMP[units[name]]]
        pose = wish.pose if wish.is_turned else self._arm.fk(joints)
        return GoalState(joints, pose, problem, None, () if is_far else tuple(jumped))

    def _target(self, wish: PoseWish) -> gemelo.ToolGoal:
        return gemelo.ToolGoal(pose=wish.pose) if wish.is_turned else gemelo.ToolGoal(position=wish.pose.position)

    def _problem_at(self, joints: Mapping[str, float]) -> Problem | None:
        try:
            self._arm.check(joints)
        except Exception as error:
            return problem_of(error)
        return None


def _angle(one: gemelo.Pose, other: gemelo.Pose) -> float:
    """[rad] by which one is turned against the other."""
    same = sum(a * b for a, b in zip(one.orientation, other.orientation, strict=True))
    return 2.0 * acos(min(1.0, abs(same)))
