"""The planning scene as a node reads it that needs the meshes' files too: each file has a key of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.topics import Subscription
from gemelo.schemas.message import Message
from gemelo.schemas.scene import PlanningScene, SceneMesh
from gemelo.schemas.scene_meshes import digests_in, mesh_digest, with_meshes
from gemelo.schemas.topics import Topic, scene_mesh

OnMessage = Callable[[Topic[Any], Message], object]


class SceneMeshes:
    """Subscribes to the files that the newest scene names, as long as it does; in the thread of logic."""

    def __init__(
        self, node: Node, on_scene: Callable[[PlanningScene], object], on_mesh: OnMessage | None = None
    ) -> None:
        """`on_scene` is given each scene with all files that are there, and again with each that comes after it.

        `on_mesh` is given each file as it comes, with its topic.
        """
        self._node, self._on_scene, self._on_mesh = node, on_scene, on_mesh
        self._scene = PlanningScene()
        self._subscriptions: dict[str, Subscription[SceneMesh]] = {}  # by digest
        self._contents: dict[str, bytes] = {}

    def on_scene(self, scene: PlanningScene) -> None:
        """The newest scene, as it was published."""
        self._scene, wanted = scene, digests_in(scene)
        for digest in self._subscriptions.keys() - wanted:
            self._subscriptions.pop(digest).close()
            self._contents.pop(digest, None)
        for digest in sorted(wanted - self._subscriptions.keys()):
            self._subscriptions[digest] = self._node.subscribe(scene_mesh(digest), self._take)
        self._on_scene(with_meshes(scene, self._contents))

    def _take(self, mesh: SceneMesh) -> None:
        if mesh.digest not in self._subscriptions or mesh_digest(mesh.data) != mesh.digest:
            return
        if self._on_mesh is not None:
            self._on_mesh(scene_mesh(mesh.digest), mesh)
        self._contents[mesh.digest] = mesh.data
        self._on_scene(with_meshes(self._scene, self._contents))
