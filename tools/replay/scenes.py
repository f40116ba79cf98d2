"""The planning scenes of a recording, and worlds made of them."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.planning import SceneVersion
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.scene_meshes import with_meshes
from gemelo.schemas.topics import SCENE
from gemelo.services.planner.collision.scene_shapes import SceneError
from gemelo.services.planner.collision.world import World
from gemelo.tools.replay.recorded import Heard, NotReplayable, Recorded


class Scenes:
    """Every recorded scene by its version; `world` keeps the last one that it has made."""

    def __init__(self, recorded: Recorded, arm: ArmDescription, kinematics: Kinematics) -> None:
        self.folders = (project_root(), arm.folder)
        self._recorded, self._arm, self._kinematics = recorded, arm, kinematics
        self.heard: dict[tuple[int, int], Heard[PlanningScene]] = {}
        for heard in recorded.of(SCENE):
            self.heard[heard.message.version, heard.message.epoch] = heard
        self.meshes = recorded.meshes()
        self._last: tuple[SceneVersion, World] | None = None

    def scene(self, version: SceneVersion, what: str) -> PlanningScene:
        """Without the jaws; raises `NotReplayable` that says for `what` it is missed."""
        heard = self.heard.get((version.version, version.epoch))
        if heard is None:
            raise NotReplayable(
                f"{self._recorded.path}: version {version.version} of the scene, in which {what} was made, is not in "
                "it; record from the planner's start, or `scene` too"
            )
        return with_meshes(heard.message, self.meshes)

    def world(self, version: SceneVersion, what: str) -> World:
        """With the jaws; raises `NotReplayable`."""
        if self._last is None or self._last[0] != version:
            scene = self.scene(version, what)
            try:
                self._last = version, self.built(scene, version)
            except (SceneError, ValueError) as error:
                raise NotReplayable(
                    f"{self._recorded.path}: version {version.version} of the scene cannot be built here: {error}; "
                    "put the mesh where it was"
                ) from error
        return self._last[1]

    def built(self, scene: PlanningScene, version: SceneVersion) -> World:
        """The world of `scene` with the jaws of `version`; raises `SceneError`, `ValueError`."""
        with_jaws = replace(scene, objects=(*scene.objects, *version.jaws))
        return World(self._arm, self._kinematics, with_jaws, self.folders)
