"""Which planning scene is the newest: a plan that was made in an older one may lead through what stands there now."""

from __future__ import annotations

from schemas.motion import FollowErrorCode
from services.stepper_gateway.refusals import GoalRejected


class SceneVersions:
    """Of the scenes heard of; where there was none yet, every goal will do."""

    def __init__(self) -> None:
        self._newest: int | None = None
        self._highest = 0

    def heed(self, version: int) -> None:
        """The planner tells its scene: after every change, and again after a restart."""
        self._newest, self._highest = version, max(self._highest, version)

    def require_newest(self, planned: int | None) -> None:
        """Raises `GoalRejected` for a plan made in another scene; None was made in none.

        A version higher than any heard of is news that the client had sooner than the gateway.
        """
        if planned is None or self._newest is None or planned == self._newest or planned > self._highest:
            return
        raise GoalRejected(
            FollowErrorCode.SCENE_CHANGED,
            f"planned in scene version {planned}, the scene is version {self._newest} now: plan again",
        )
