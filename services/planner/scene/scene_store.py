"""The planning scene as the planner holds it: always valid, its version one more with every change.

Epoch 0 is the empty scene of before the first change, which draws an epoch: so no two scenes share epoch and version.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import msgspec

from schemas.scene import PlanningScene, SceneGrip, SceneRelease, SceneRequest, SceneResponse
from services.arm.model.description import ArmDescription
from services.planner.collision.scene_shapes import Folders, SceneError
from services.planner.scene.grasp import find_grasp
from services.planner.scene.scene_check import require_scene
from services.planner.scene.scene_edit import LinkPoses, edited
from services.runtime.clock import SYSTEM, Clock

W = TypeVar("W")


class SceneStore:
    """Takes a change wholly or not at all; mesh files are looked for in `folders`."""

    def __init__(
        self, arm: ArmDescription, folders: Folders = (), scene: PlanningScene | None = None, clock: Clock = SYSTEM
    ) -> None:
        """Raises `SceneError` for a scene that cannot be."""
        self._clock = clock
        self._arm, self._folders = arm, folders
        self.scene = scene or PlanningScene()
        require_scene(arm, self.scene, folders)

    def touch(self, stamp: int) -> None:
        """The same scene counts as another: what was planned in it must not be followed any more."""
        if self.scene.epoch:
            self.scene = msgspec.structs.replace(self.scene, stamp=stamp, version=self.scene.version + 1)

    def edit(self, request: SceneRequest, links: LinkPoses, stamp: int) -> SceneResponse:
        """True if the scene is changed, or why not; `links` says where the links are now, `stamp` is [ns] UNIX."""
        name, width = "", 0.0
        try:
            grasp = None
            if isinstance(request.edit, SceneGrip):
                grasp = find_grasp(self._arm, self.scene, links(), self._folders)
                name, width = ("", 0.0) if grasp is None else (grasp.item.name, grasp.width)
            elif isinstance(request.edit, SceneRelease):
                name = next((item.name for item in self.scene.objects if item.gripped), "")
            changed = edited(self._arm, self.scene, request.edit, links, grasp)
            if changed != self.scene:
                require_scene(self._arm, changed, self._folders)
                epoch, version = self.scene.epoch or drawn_epoch(self._clock), self.scene.version + 1
                self.scene = msgspec.structs.replace(changed, stamp=stamp, version=version, epoch=epoch)
        except SceneError as error:
            return SceneResponse(reason=str(error), version=self.scene.version)
        return SceneResponse(accepted=True, version=self.scene.version, name=name, width=width)


def changed(
    store: SceneStore, request: SceneRequest, links: LinkPoses, stamp: int, built: Callable[[PlanningScene], W]
) -> tuple[SceneResponse, W | None]:
    """As `SceneStore.edit`, with what `built` makes of the changed scene; None where it is as it was.

    A scene of which `built` raises `SceneError` or `ValueError` is refused, and the store left as it was.
    """
    before = store.scene
    response = store.edit(request, links, stamp)
    if store.scene is before:
        return response, None
    try:
        return response, built(store.scene)
    except (SceneError, ValueError) as error:
        store.scene = before
        return SceneResponse(reason=str(error), version=before.version), None


def drawn_epoch(clock: Clock) -> int:
    """Another epoch than any before: 62 random bits."""
    return clock.bits(62) + 1
