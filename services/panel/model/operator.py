"""Everything that the page can do, and what all browsers share: goal, plan, motion, jog, problems."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import gemelo
from gemelo.libraries.arm.cell.cell_file import deployed_cell
from gemelo.services.panel.model.cameras import CameraPictures
from gemelo.services.panel.model.goal import GoalSolver
from gemelo.services.panel.model.jogging import Jogging
from gemelo.services.panel.model.live import LiveSliders
from gemelo.services.panel.model.motions import MotionChoice, Motions
from gemelo.services.panel.model.picks import Picks
from gemelo.services.panel.model.problems import Problem, problem_of
from gemelo.services.panel.model.readings import BusReadings
from gemelo.services.panel.model.stop_lane import StopLane
from gemelo.services.panel.model.teaching import Teaching

PAGE = "the page"  # the holder's name, where the page has taken control
KEPT = 30.0  # [s] that a problem stays on the page


@dataclass(frozen=True)
class ToldProblem:
    """A problem, and when it was told: [s] monotonic, and its number."""

    problem: Problem
    at: float
    number: int


class Operator:
    """One for all browsers. Any thread may call it; errors are told in `newest_problem`, never raised."""

    def __init__(self, arm: gemelo.Arm) -> None:
        self._changed = threading.Event()
        self.arm, self.bus = arm, BusReadings(arm, self.wake)
        cell = deployed_cell(arm.deployment)
        self.cameras = CameraPictures(arm, cell.camera_names)
        self.picks = Picks(arm, cell, self.tell, self.wake)
        self.choice = MotionChoice()
        self.homing: dict[str, str] = {}  # by joint what it does, while the arm homes
        self._told: ToldProblem | None = None
        self.goal = GoalSolver(arm, self.wake)
        arm.node.subscribe(gemelo.topics.SCENE, lambda scene: self.goal.check_again())  # whoever has changed it
        self.motions = Motions(arm, self.tell)
        self.jogging = Jogging(arm, self._jog_refused)
        self.teaching = Teaching(arm, self.wake)
        self.live = LiveSliders(arm, self.jogging, self.bus)
        self._stops = StopLane(arm, self.tell, self._end_all)

    def close(self) -> None:
        """Ends its threads; the arm brakes where the page has led it by hand."""
        self._stops.close()
        self.teaching.stop()
        self.live.close()
        self.jogging.close()
        self.goal.close()

    def wake(self) -> None:
        """Something that is shown has changed."""
        self._changed.set()

    def wait(self, timeout: float) -> bool:
        """True after a change, False after `timeout` [s] without one."""
        has_changed = self._changed.wait(timeout)
        self._changed.clear()
        return has_changed

    def tell(self, problem: Problem) -> None:
        """Shows it at every browser."""
        number = self._told.number + 1 if self._told is not None else 1
        self._told = ToldProblem(problem, time.monotonic(), number)
        self.wake()

    def mended(self, told: ToldProblem | None) -> None:
        """Something was done after `told`: a refusal of a press that went before is over, and nothing newer is."""
        if told is not None and told is self._told and told.problem.is_refusal:
            self.forget_problem()

    def _jog_refused(self, problem: Problem) -> None:
        """Something else leads the arm, or nothing may: the live sliders let go."""
        self.live.switch(False)
        self.tell(problem)

    @property
    def newest_problem(self) -> ToldProblem | None:
        """The last one, while it is young."""
        told = self._told
        return told if told is not None and time.monotonic() - told.at < KEPT else None

    def forget_problem(self) -> None:
        """It has been read, or mended."""
        self._told = None
        self.wake()

    # Goals

    def set_goal(self, joints: Mapping[str, float], source: int = -1) -> None:
        """Joint values [rad] or [m] from sliders; with live sliders the arm follows."""
        self.goal.set_joints(joints, source)
        self.live.follow(self.goal.goal.joints)
        self.wake()

    def set_named(self, name: str, source: int = -1) -> None:
        """A named state as the goal."""
        self.set_goal(self.arm.states[name], source)

    def take_nearest(self, problem: Problem) -> None:
        """The nearest goal that can be, of the goal's problem or of a refusal."""
        nearest = problem.nearest
        joints = nearest.get("joints")
        if isinstance(joints, Mapping):
            self.set_goal(joints)
        elif "position" in nearest:
            x, y, z = nearest["position"]
            turned = nearest.get("orientation")
            orientation = tuple(turned) if turned else self.goal.goal.pose.orientation
            a, b, c, d = orientation
            self.goal.set_pose(gemelo.Pose((x, y, z), (a, b, c, d)), is_turned=bool(turned))
        self.forget_problem()

    def follow_measured(self) -> None:
        """The goal is where the arm is, and no plan leads there."""
        self.motions.forget_plan()
        self.guarded(lambda: self.set_goal(self.arm.joints))

    # Motions

    def plan(self) -> None:
        """A path to the goal, shown and not gone; `motions.ask` has gone before."""
        self.forget_problem()
        self.motions.make_asked(self._target)
        self.wake()

    def execute(self) -> None:
        """Goes along the plan that is shown."""
        self.forget_problem()
        self.motions.execute()
        self.wake()

    def plan_and_execute(self) -> None:
        """Both; `motions.ask` has gone before."""
        self.forget_problem()
        self.motions.make_asked_and_execute(self._target)
        self.wake()

    def _target(self) -> gemelo.Target:
        """To the goal that was wanted last, once it is found."""
        self.goal.wait()
        return self.choice.target(dict(self.goal.goal.joints))

    def step(self, target: gemelo.Target) -> None:
        """A small motion by a button, at once."""
        self.forget_problem()
        target["speed"] = self.choice.speed
        self.motions.make_and_execute(target)
        self.wake()

    def stop(self) -> None:
        """Before everything else; also what is planned just now does not begin. Returns without waiting."""
        self.motions.on_stop()
        self.picks.on_stop()
        self._stops.press()

    def _end_all(self) -> None:
        """What would move the arm again by itself."""
        self.jogging.release()
        self.live.switch(False)
        self.guarded(self.teaching.stop)

    def set_speed(self, share: float) -> None:
        """The share of full speed of everything that is played from now on."""
        self.guarded(lambda: self.arm.speed(share))

    def take_control(self, force: bool = False) -> None:
        """For everybody who has this page open; `force`: also from another holder."""
        self.forget_problem()
        self.guarded(lambda: self.arm.control.take(PAGE, force=force))

    def give_control(self) -> None:
        """Everybody may move the arm again."""
        self.guarded(self.arm.control.give)

    def home(self, *joints: str) -> None:
        """All joints with a switch, or those named; `homing` says how far."""

        def follow(phases: dict[str, str]) -> None:
            self.homing = dict(phases)
            self.wake()

        self.guarded(lambda: self.arm.home(*joints, on_progress=follow))
        self.homing = {}
        self.wake()

    def guarded(self, action: Callable[[], object]) -> bool:
        """Does it; False, and the problem told, where it was refused."""
        try:
            action()
        except Exception as error:
            self.tell(problem_of(error))
            return False
        self.wake()
        return True
