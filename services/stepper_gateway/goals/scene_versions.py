"""The newest planning scene: a plan that was made in an older one may lead through what stands there now."""

from __future__ import annotations

from typing import NamedTuple

from schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from schemas.scene import PlanningScene
from services.stepper_gateway.goals.rejections import GoalRejected

MOST_UNHEARD = 10_000  # chosen: edits of one scene that may be missed in a row; more is no planner's version


class PlannedIn(NamedTuple):
    """The scene that a goal was planned in; None where the goal does not say it."""

    version: int | None
    epoch: int | None

    @classmethod
    def of(cls, goal: FollowJointTrajectoryGoal) -> PlannedIn:
        return cls(goal.scene_version, goal.scene_epoch)


class SceneVersions:
    """Compares goals with the newest scene that the planner has told; before the first, every goal will do."""

    def __init__(self) -> None:
        self.dropped = 0  # scenes with a version that no planner gives
        self._newest: PlanningScene | None = None

    def take(self, scene: PlanningScene) -> str:
        """The planner tells its scene: after every change, and again after a restart; why it is dropped, or empty.

        Versions grow by one within an epoch, and go back only where a restart finds an older file.
        """
        if objection := self._objection(scene):
            self.dropped += 1
            return objection
        self._newest = scene
        return ""

    def require_newest(self, planned: PlannedIn) -> None:
        """Raises `GoalRejected` for a plan made in another scene; one without a version was made in none.

        A higher version of the same epoch is news that the client had sooner than the gateway.
        """
        newest = self._newest
        if planned.version is None or newest is None:
            return
        if planned.epoch not in (None, newest.epoch):
            raise _changed(
                f"planned in version {planned.version} of a scene that the planner holds no more; another one is at "
                f"version {newest.version} now"
            )
        if planned.version < newest.version:
            raise _changed(f"planned in scene version {planned.version}, the scene is version {newest.version} now")

    def _objection(self, scene: PlanningScene) -> str:
        if scene.version < 0:
            return f"version {scene.version} is negative"
        newest = self._newest
        if newest is None or scene.epoch != newest.epoch:
            return ""
        if scene.version > newest.version + MOST_UNHEARD:
            return f"version {scene.version} is more than {MOST_UNHEARD} changes after version {newest.version}"
        return ""


def _changed(what: str) -> GoalRejected:
    return GoalRejected(FollowErrorCode.SCENE_CHANGED, f"{what}: plan again")
