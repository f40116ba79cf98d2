"""The planning scene: what stands around the arm, what it carries, and what may touch what."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue

from gemelo.api.arguments import Vector
from gemelo.api.errors import BadArgument, Lost, Refused
from gemelo.api.scene_files import load_mesh, read_scene, write_scene
from gemelo.api.session import PATIENCE, Session
from gemelo.api.targets import number, point, quaternion, vector
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.scene import (
    AllowedPair,
    BoxShape,
    CylinderShape,
    PlaneShape,
    PlanningScene,
    SceneAdd,
    SceneAllow,
    SceneAttach,
    SceneClear,
    SceneDetach,
    SceneDisallow,
    SceneEdit,
    SceneMesh,
    SceneMove,
    SceneObject,
    SceneRemove,
    SceneReplace,
    SceneRequest,
    SceneResize,
    SceneResponse,
    Shape,
    SphereShape,
)
from gemelo.schemas.scene_meshes import digests_in, with_meshes
from gemelo.schemas.topics import SCENE, SCENE_EDIT, scene_mesh

TO_ANSWER = 10.0  # [s] a mesh of many triangles takes the planner some
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)


class Scene:
    """What stands around the arm; every plan keeps clear of it. Places are in metres, in the base frame if not said.

    >>> arm.scene.add_box("post", size=(0.04, 0.04, 0.16), at=(0.29, 0.27, 0.08))
    >>> sorted(arm.scene.objects)
    ['post']
    >>> arm.scene.clear()
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._version = self._epoch = 0  # of the last edit

    def add_box(
        self,
        name: str,
        size: Vector,
        at: Vector = ORIGIN,
        orientation: Vector = UPRIGHT,
        *,
        frame: str = "",
        attach: bool = False,
        touch: Iterable[str] = (),
        padding: float = 0.0,
    ) -> None:
        """A box of edges `size` (3,) [m] around `at` (3,) [m] in `frame`; one of that name is replaced.

        `orientation`: quaternion (x, y, z, w). `attach`: the link `frame` carries it, and it may touch the links
        `touch`. `padding` [m] is kept around it.

        >>> arm.scene.add_box("table", size=(0.6, 0.4, 0.02), at=(0.3, 0.0, -0.05))
        >>> arm.scene.remove("table")
        """
        shape = BoxShape(size=vector("size", size, 3, "whole edges in m"))
        self._add(name, shape, at, orientation, frame, attach, touch, padding)

    def add_sphere(
        self,
        name: str,
        radius: float,
        at: Vector = ORIGIN,
        *,
        frame: str = "",
        attach: bool = False,
        touch: Iterable[str] = (),
        padding: float = 0.0,
    ) -> None:
        """A sphere of `radius` [m] around `at` (3,) [m]; the rest as in `add_box`.

        >>> arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.remove("ball")
        """
        self._add(name, SphereShape(radius=number("radius", radius)), at, UPRIGHT, frame, attach, touch, padding)

    def add_cylinder(
        self,
        name: str,
        radius: float,
        length: float,
        at: Vector = ORIGIN,
        orientation: Vector = UPRIGHT,
        *,
        frame: str = "",
        attach: bool = False,
        touch: Iterable[str] = (),
        padding: float = 0.0,
    ) -> None:
        """A cylinder of `radius` and `length` [m] along z around `at` (3,) [m]; the rest as in `add_box`.

        >>> arm.scene.add_cylinder("cup", radius=0.01, length=0.02, at=(0.2, 0.3, 0.04))
        >>> arm.scene.remove("cup")
        """
        shape = CylinderShape(radius=number("radius", radius), length=number("length", length))
        self._add(name, shape, at, orientation, frame, attach, touch, padding)

    def add_plane(
        self, name: str, at: Vector = ORIGIN, orientation: Vector = UPRIGHT, *, frame: str = "", padding: float = 0.0
    ) -> None:
        """All that lies below z = 0 of the pose (`at` [m], `orientation`) is solid.

        >>> arm.scene.add_plane("floor", at=(0.0, 0.0, -0.1))
        >>> arm.scene.remove("floor")
        """
        self._add(name, PlaneShape(), at, orientation, frame, False, (), padding)

    def add_mesh(
        self,
        name: str,
        path: str | Path,
        at: Vector = ORIGIN,
        orientation: Vector = UPRIGHT,
        *,
        scale: float | None = None,
        frame: str = "",
        attach: bool = False,
        touch: Iterable[str] = (),
        padding: float = 0.0,
    ) -> None:
        """The STL file `path`, `scale` metres to its unit (0.001 where it is in mm) [1]; the rest as in `add_box`.

        >>> arm.scene.add_mesh("vice", "tests/gemelo/wedge.stl", at=(0.0, 0.5, 0.0), scale=0.001)
        >>> arm.scene.remove("vice")
        """
        self._add(name, load_mesh(path, scale), at, orientation, frame, attach, touch, padding)

    def remove(self, name: str) -> None:
        """Takes an object away; `Refused` where there is none of that name.

        >>> arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneRemove(name=name))

    def move(self, name: str, at: Vector, orientation: Vector = UPRIGHT, *, frame: str = "") -> None:
        """Puts an object elsewhere: `at` (3,) [m], turned by `orientation`, in `frame` as it is now.

        >>> arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.move("ball", at=(0.3, 0.3, 0.1))
        >>> arm.scene.objects["ball"].pose.translation
        (0.3, 0.3, 0.1)
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneMove(name=name, pose=_pose(at, orientation), frame=frame))

    def resize(self, name: str, shape: Shape) -> None:
        """Gives an object another shape: `gemelo.schemas.scene.BoxShape(size=...)` and its kin, or `load_mesh(...)`.

        >>> from gemelo.schemas.scene import SphereShape
        >>> arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.resize("ball", SphereShape(radius=0.02))
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneResize(name=name, shape=shape))

    def attach(self, name: str, to: str, touch: Iterable[str] = ()) -> None:
        """From now on the link `to` carries the object, from where it is; it may touch the links `touch` too.

        >>> arm.scene.add_sphere("ball", radius=0.01, at=arm.pose().offset(z=-0.03).position)
        >>> arm.scene.attach("ball", to=arm.tool_frame)
        >>> arm.scene.objects["ball"].attached
        True
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneAttach(name=name, link=to, touch_links=tuple(touch)))

    def detach(self, name: str) -> None:
        """Leaves a carried object where it is.

        >>> arm.scene.add_sphere("ball", radius=0.01, at=(0.0, 0.0, -0.03), frame=arm.tool_frame, attach=True)
        >>> arm.scene.detach("ball")
        >>> arm.scene.objects["ball"].attached
        False
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneDetach(name=name))

    def allow(self, first: str, second: str) -> None:
        """Lets two links or objects touch; "*" is any.

        >>> arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.allow("ball", "efector_link")
        >>> [(pair.first, pair.second) for pair in arm.scene.present.allowed]
        [('ball', 'efector_link')]
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneAllow(pair=AllowedPair(first=first, second=second)))

    def disallow(self, first: str, second: str) -> None:
        """Takes an `allow` back.

        >>> arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.allow("ball", "*")
        >>> arm.scene.disallow("ball", "*")
        >>> arm.scene.present.allowed
        ()
        >>> arm.scene.remove("ball")
        """
        self.edit(SceneDisallow(pair=AllowedPair(first=first, second=second)))

    def clear(self) -> None:
        """Takes everything away.

        >>> arm.scene.clear()
        >>> arm.scene.objects
        {}
        """
        self.edit(SceneClear())

    def replace(self, scene: PlanningScene) -> None:
        """The whole scene at once.

        >>> before = arm.scene.present
        >>> arm.scene.clear()
        >>> arm.scene.replace(before)
        """
        self.edit(SceneReplace(scene=scene))

    def edit(self, edit: SceneEdit) -> SceneResponse:
        """One change as the planner's own message; its answer has the new version. Raises `Refused`.

        >>> from gemelo.schemas.scene import SceneClear
        >>> arm.scene.edit(SceneClear()).version == arm.scene.present.version
        True
        """
        response = self._session.call(SCENE_EDIT, SceneRequest(edit=edit), TO_ANSWER)
        if not response.accepted:
            changed = edit.object if isinstance(edit, SceneAdd) else edit
            why = response.why or plain(response.reason)
            name = getattr(changed, "name", "")
            raise Refused(because("refused.plan", why), check="scene", subject=name, reason=why)
        heard = self._session.latest(SCENE).message
        self._version, self._epoch = response.version, heard.epoch if heard is not None else 0
        return response

    @contextmanager
    def restored(self) -> Iterator[None]:
        """Leaves the scene as it was found when the block ends, however it ends.

        >>> with arm.scene.restored():
        ...     arm.scene.add_sphere("ball", radius=0.03, at=(0.3, 0.25, 0.1))
        >>> arm.scene.objects
        {}
        """
        found = self.present
        try:
            yield
        finally:
            self.replace(found)

    @property
    def present(self) -> PlanningScene:
        """The scene as it is now, every edit of this script included.

        >>> arm.scene.present.version > 0
        True
        """
        latest = self._session.latest(SCENE)

        def has_last_edit() -> bool:
            scene = latest.message
            return scene is not None and (scene.version >= self._version or scene.epoch != self._epoch)

        self._session.wait_for(has_last_edit, PATIENCE)
        return self._session.newest(SCENE)

    def whole(self) -> PlanningScene:
        """The scene as it is now with the files of its meshes, which it names by their digests otherwise.

        >>> arm.scene.whole() == arm.scene.present
        True
        """
        scene = self.present
        return with_meshes(scene, {digest: self._mesh(digest) for digest in digests_in(scene)})

    def _mesh(self, digest: str) -> bytes:
        """The file of a mesh that stands in the scene; raises `Lost`."""
        found: SimpleQueue[bytes] = SimpleQueue()
        topic = scene_mesh(digest)

        def take(mesh: SceneMesh) -> None:
            found.put(mesh.data)
            self._session.notify()

        subscription = self._session.node.subscribe(topic, take)
        try:
            if not self._session.wait_for(lambda: not found.empty(), TO_ANSWER):
                raise Lost(because("lost.mesh", topic=topic.key, time=TO_ANSWER))
        finally:
            subscription.close()
        return found.get()

    @property
    def objects(self) -> dict[str, SceneObject]:
        """All objects, by name.

        >>> arm.scene.objects
        {}
        """
        return {item.name: item for item in self.present.objects}

    def save(self, path: str | Path) -> None:
        """Writes the scene as JSON, for `load` and `gemelo scene load`; raises `Error` where that cannot be.

        >>> arm.scene.save(folder + "/cell.json")
        """
        write_scene(self.whole(), Path(path))

    def load(self, path: str | Path) -> None:
        """Replaces the scene by a file's; raises `Error` where it holds none.

        >>> arm.scene.save(folder + "/cell.json")
        >>> arm.scene.load(folder + "/cell.json")
        """
        self.replace(read_scene(Path(path)))

    def _add(
        self,
        name: str,
        shape: Shape,
        at: Vector,
        orientation: Vector,
        frame: str,
        attach: bool,
        touch: Iterable[str],
        padding: float,
    ) -> None:
        if attach and not frame:
            raise BadArgument(because("argument.attach", needed="frame"))
        item = SceneObject(
            name=name,
            shape=shape,
            pose=_pose(at, orientation),
            frame=frame,
            attached=attach,
            touch_links=tuple(touch),
            padding=number("padding", padding),
        )
        self.edit(SceneAdd(object=item))


def _pose(at: Vector, orientation: Vector) -> Transform:
    return Transform(translation=point("at", at), rotation=quaternion("orientation", orientation))
