"""The newest planning scene: a plan that was made in an older one may lead through what stands there now.

The scene is that of one living planner. Each process of that name signs its scenes with its instance, the end of its
liveliness token, in which the one that started later is the greater.
"""

from __future__ import annotations

from typing import NamedTuple

from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected

MOST_UNHEARD = 10_000  # chosen: edits of one scene that may be missed in a row; more is no planner's version
MOST_PLANNERS = 8  # whose scenes are kept; chosen: more than are started within a reader's delay


class PlannedIn(NamedTuple):
    """The scene that a goal was planned in; None where the goal does not say it."""

    version: int | None
    epoch: int | None

    @classmethod
    def of(cls, goal: FollowJointTrajectoryGoal) -> PlannedIn:
        return cls(goal.scene_version, goal.scene_epoch)


class SceneVersion(NamedTuple):
    """All of a published scene that counts here."""

    version: int
    epoch: int


class SceneVersions:
    """Compares goals with the newest scene of the living planner; before the first, every goal will do.

    While no planner is known to live, the newest scene of any counts.
    """

    def __init__(self) -> None:
        self.dropped = 0  # scenes that no planner gives, or not the living one
        self._newest: dict[str, SceneVersion] = {}  # by instance, the one that has published last at the end
        self._living: set[str] = set()
        self._holder: str | None = None  # the instance whose scene it is; None before the first that lives

    def on_planner(self, instance: str, is_there: bool) -> None:
        """The token of a planner's process has come or gone.

        A router that is away takes all tokens with it: the scene stays that of the last one.
        """
        (self._living.add if is_there else self._living.discard)(instance)
        self._choose()

    def take(self, scene: SceneVersion, instance: str = "") -> str:
        """A planner publishes its scene: after every change, and again after a restart; why it is dropped, or empty.

        Versions grow by one within an epoch, and go back only where a restart finds an older file.
        """
        if objection := self._objection(scene, instance):
            self.dropped += 1
            return objection
        self._newest.pop(instance, None)
        self._newest[instance] = scene
        self._choose()
        if self._holder is not None and instance != self._holder:
            self.dropped += 1
            return f"it comes from {_process(instance)}; the planner that lives is {_process(self._holder)}"
        return ""

    def require_newest(self, planned: PlannedIn) -> None:
        """Raises `GoalRejected` for a plan made in another scene; one without a version was made in none.

        A higher version of the same epoch is news that the client had sooner than the gateway.
        """
        newest = self._scene
        if planned.version is None or newest is None:
            return
        if rivals := self.rivals:
            raise GoalRejected(FollowErrorCode.SCENE_CHANGED, rivals)
        if planned.epoch not in (None, newest.epoch):
            raise _changed("goal.scene.other_planner", planned.version, newest.version)
        if planned.version < newest.version:
            raise _changed("goal.scene.changed", planned.version, newest.version)

    @property
    def rivals(self) -> Reason | None:
        """That two living planners have both published a scene, the older one first; None if there is one at most."""
        if len(self._living) < 2 or len(both := sorted(self._living & self._newest.keys())) < 2:
            return None
        return because("goal.scene.two_planners", *map(_process, both[-2:]))

    @property
    def _scene(self) -> SceneVersion | None:
        if self._holder is not None:
            return self._newest[self._holder]
        return next(reversed(self._newest.values()), None)

    def _choose(self) -> None:
        """The holder is the living planner that started last, of those that have published a scene."""
        self._holder = max(self._living & self._newest.keys(), default=self._holder)
        while len(self._newest) > MOST_PLANNERS:
            del self._newest[next(one for one in self._newest if one != self._holder)]

    def _objection(self, scene: SceneVersion, instance: str) -> str:
        if scene.version < 0:
            return f"version {scene.version} is negative"
        newest = self._newest.get(instance)
        if newest is None or scene.epoch != newest.epoch:
            return ""
        if scene.version > newest.version + MOST_UNHEARD:
            return f"version {scene.version} is more than {MOST_UNHEARD} changes after version {newest.version}"
        return ""


def _process(instance: str) -> Reason:
    """`process 123 on this-host`."""
    _, _, place = instance.partition(".")
    pid, _, host = place.partition(".")
    return because("goal.scene.process", pid=pid, host=host) if host else because("goal.scene.unsigned_process")


def _changed(code: str, version: int, newest: int) -> GoalRejected:
    reason = because(code, remedy("plan_again"), version=version, newest=newest)
    return GoalRejected(FollowErrorCode.SCENE_CHANGED, reason)
