"""The planning scene as the planner holds it: always valid, its version one more with every change.

Epoch 0 is the empty scene of before the first change, which draws an epoch: so no two scenes share epoch and version.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import msgspec

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.bus.wire import TooLarge, encoded
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.scene import PlanningScene, SceneGrip, SceneRelease, SceneRequest, SceneResponse
from gemelo.schemas.scene_meshes import by_digest, edit_with_meshes, meshes_in
from gemelo.services.planner.collision.scene_shapes import Folders, SceneError
from gemelo.services.planner.scene.grasp import find_grasp
from gemelo.services.planner.scene.scene_check import require_scene
from gemelo.services.planner.scene.scene_edit import LinkPoses, edited

W = TypeVar("W")

MOST_KEPT = 64 * 1024 * 1024  # [bytes] of files that are in the scene no more; chosen: two of the largest


class KnownMeshes:
    """Files by their digests; one that has left the scene is kept until too many have."""

    def __init__(self) -> None:
        self._contents: dict[str, bytes] = {}  # the one that has been in a scene last is the last

    @property
    def contents(self) -> Mapping[str, bytes]:
        return self._contents

    def learn(self, contents: Mapping[str, bytes]) -> None:
        """Files that somebody has, as of a recording."""
        self._contents = {**contents, **self._contents}

    def keep(self, scene: PlanningScene) -> None:
        """The scene is the newest one."""
        present = meshes_in(scene)
        for digest in present:
            self._contents.pop(digest, None)
        self._contents |= present
        spare = [digest for digest in self._contents if digest not in present]
        size = sum(len(self._contents[digest]) for digest in spare)
        for digest in spare:
            if size <= MOST_KEPT:
                break
            size -= len(self._contents.pop(digest))


class SceneStore:
    """Takes a change wholly or not at all; mesh files are looked for in `folders`."""

    def __init__(
        self, arm: ArmDescription, folders: Folders = (), scene: PlanningScene | None = None, clock: Clock = SYSTEM
    ) -> None:
        """Raises `SceneError` for a scene that cannot be."""
        self._clock = clock
        self._arm, self._folders = arm, folders
        self.scene = scene or PlanningScene()
        self.meshes = KnownMeshes()
        require_scene(arm, self.scene, folders)
        self.meshes.keep(self.scene)

    def touched(self, stamp: int) -> PlanningScene:
        """The same scene as another one: what was planned in it must not be followed any more."""
        if not self.scene.epoch:
            return self.scene
        return msgspec.structs.replace(self.scene, stamp=stamp, version=self.scene.version + 1)

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
            edit = edit_with_meshes(request.edit, self.meshes.contents)
            changed = edited(self._arm, self.scene, edit, links, grasp)
            if changed != self.scene:
                require_scene(self._arm, changed, self._folders)
                epoch, version = self.scene.epoch or drawn_epoch(self._clock), self.scene.version + 1
                changed = msgspec.structs.replace(changed, stamp=stamp, version=version, epoch=epoch)
                _require_sendable(changed)
                self.scene = changed
                self.meshes.keep(changed)
        except SceneError as error:
            return SceneResponse(reason=str(error), version=self.scene.version, why=error.reason)
        return SceneResponse(accepted=True, version=self.scene.version, name=name, width=width)


def changed(
    store: SceneStore, request: SceneRequest, links: LinkPoses, stamp: int, built: Callable[[PlanningScene], W]
) -> tuple[SceneResponse, W | None]:
    """As `SceneStore.edit`, with what `built` makes of the changed scene; None where it is as it was.

    A scene of which `built` raises `SceneError` or `ValueError` is refused; whatever it raises, the store is left as it
    was.
    """
    before = store.scene
    response = store.edit(request, links, stamp)
    if store.scene is before:
        return response, None
    try:
        return response, built(store.scene)
    except ValueError as error:
        store.scene = before
        why = error.reason if isinstance(error, ReasonedError) else plain(str(error))
        return SceneResponse(reason=str(why), version=before.version, why=why), None
    except BaseException:
        store.scene = before
        raise


def _require_sendable(scene: PlanningScene) -> None:
    """Raises `SceneError` for a scene that could not be published: it is refused before anything has changed."""
    try:
        encoded(by_digest(scene))
    except TooLarge as error:
        raise SceneError(because("scene.too_large", size=error.size, limit=error.limit)) from error


def drawn_epoch(clock: Clock) -> int:
    """Another epoch than any before: 62 random bits."""
    return clock.bits(62) + 1
