"""The scene on the bus: edits in, the scene and what touches out, and the file that survives a restart."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import jaw_objects, jaws_apart
from gemelo.libraries.runtime.bus.wire import Encoded, encoded
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.unwritten import RETRY
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import PlanCode, PlanResponse
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.scene import (
    Contacts,
    PlanningScene,
    SceneGrip,
    SceneMesh,
    SceneRelease,
    SceneRequest,
    SceneResponse,
)
from gemelo.schemas.scene_meshes import by_digest, meshes_in
from gemelo.schemas.topics import CONTACTS, GRIPPER_STATE, SCENE, SCENE_EDIT, scene_mesh
from gemelo.services.planner.collision.clearance import ROUNDING
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.scene.answer_log import AnswerLog
from gemelo.services.planner.scene.scene_check import usable_part
from gemelo.services.planner.scene.scene_file import FILE, DamagedScene, load_scene, put_aside, save_scene
from gemelo.services.planner.scene.scene_store import SceneStore, changed, drawn_epoch
from gemelo.services.planner.scene.standing import link_poses, standing, version_of

SETTLING = 0.003  # [m] chosen: by less the jaws settle, and plans stay those of the present scene
PUBLISH_AGAIN = 0.5  # [s] between two answers to the scenes of others; chosen: two planners do not flood each other
OWN = 8  # of its own scenes that a planner knows again; chosen: more than are published within a reader's delay
OnWorld = Callable[[World], None]


@dataclass(frozen=True)
class Showing:
    """A scene with everything that is made of it before any of it is shown: what cannot be made changes nothing."""

    world: World  # of the thread of logic
    world_of_plans: World  # a world is no thing for two threads
    message: Encoded[PlanningScene]
    meshes: dict[str, Encoded[SceneMesh]]  # by digest, all of the scene
    contacts: Encoded[Contacts] | None = None  # where the arm stands, after an edit


class SceneKeeper:
    """Holds the scene of one arm; `on_world` is told of the first world and of every later one.

    `world` is for the node's thread of logic alone.
    """

    def __init__(
        self,
        node: Node,
        arm: ArmDescription,
        states: Latest[JointState],
        folder: Path,
        on_world: OnWorld,
        log: AnswerLog,
    ) -> None:
        self._node, self._arm, self._states, self._on_world = node, arm, states, on_world
        self._kinematics = Kinematics(arm)  # its own: the planner's is in use in another thread
        self._file, self._log = folder / FILE, log
        self._what, self._is_unsaved = f"the scene in {self._file}, which a restart forgets otherwise,", False
        self._folders = (project_root(), arm.folder)
        self._scene, self._contacts = node.publisher(SCENE), node.publisher(CONTACTS)
        self._published: deque[PlanningScene] = deque(maxlen=OWN)
        self._shown: set[str] = set()  # digests of the meshes that are published
        self._store = SceneStore(arm, self._folders, self._restored(), node.clock)
        self._is_touching = False
        self._apart: float | None = None  # [m] of the jaws; None before the first word of them
        self.world = self._built(self._store.scene)
        self._show(self._prepared(self._store.scene))
        node.serve(SCENE_EDIT, self._edit)
        node.every(RETRY, self._save_again)
        self._other: PlanningScene | None = None  # that another process has published under this name
        node.subscribe(SCENE, self._on_other_scene)
        node.every(PUBLISH_AGAIN, self._publish_again)
        if jaw_objects(arm, 0.0):
            node.subscribe(GRIPPER_STATE, self._on_gripper)

    @property
    def scene(self) -> PlanningScene:
        """The scene with the files of its meshes, without the gripper's jaws."""
        return self._store.scene

    def show_refusal(self, response: PlanResponse) -> None:
        """Shows what touches where a plan was refused, until one succeeds."""
        refusal = response.refusal
        if refusal is not None and refusal.configuration:
            margin = self._arm.clearance if refusal.limit is None else refusal.limit
            touching = tuple(self.world.contacts(refusal.configuration, margin + ROUNDING))
            names = self._arm.joint_names
            self._contacts.put(
                Contacts(stamp=self._node.now(), name=names, position=refusal.configuration, contacts=touching)
            )
            self._is_touching = True
        elif response.code is PlanCode.SUCCESS and self._is_touching:
            self._contacts.put(Contacts(stamp=self._node.now()))
            self._is_touching = False

    def _on_other_scene(self, other: PlanningScene) -> None:
        """Another process has published a scene under this planner's name: a second planner, or a stray message."""
        if other not in self._published:  # a late joiner is given the last one, which may be this planner's own
            self._other = other

    def _publish_again(self) -> None:
        """Whoever followed the other scene gets this planner's; of two planners the older ends (bus/name_holder.py)."""
        other, self._other = self._other, None
        if other is not None:
            self._node.log.warning(
                "another process has published a scene as this planner, version %d of epoch %d: is there a second one? "
                "The scene of this one is published again", other.version, other.epoch,
            )  # fmt: skip
            self._publish(encoded(by_digest(self._store.scene)))

    def _on_gripper(self, state: GripperState) -> None:
        """The jaws have another opening: everything is checked with them there from now on.

        A plan that was made with narrower jaws is of another scene, whose version counts on.
        """
        apart = jaws_apart(self._arm, state)
        if apart == self._apart:
            return
        before, self._apart = self._apart, apart
        has_opened = before is not None and apart > before + SETTLING
        try:
            scene = self._store.touched(self._node.now()) if has_opened else self._store.scene
            showing = self._prepared(scene)
        except BaseException:
            self._apart = before
            raise
        self._store.scene = scene
        self._take_worlds(showing)
        if has_opened:
            self._publish(showing.message)

    def _edit(self, request: SceneRequest) -> Encoded[SceneResponse]:
        before, apart, stamp = self._store.scene, self._apart, self._node.now()
        present, age = self._states.message, self._states.age()
        links = lambda: link_poses(self._kinematics, standing(self._arm, present, age))  # noqa: E731
        try:
            self._take_opening(request)
            response, showing = changed(self._store, request, links, stamp, self._prepared_edit)
            if showing is None and self._apart != apart:
                showing = self._prepared_edit(self._store.scene)
            answer = encoded(response)
        except BaseException:
            self._store.scene, self._apart = before, apart
            raise
        self._log.tell(SCENE_EDIT, stamp, present, age, version_of(self._with_jaws(before)))
        if showing is None:
            return answer
        self._show(showing)
        if showing.contacts is not None:
            self._tell_what_touches_here(showing.contacts)
        unsaved = self._save(self._store.scene)
        if unsaved is None:
            return answer
        return encoded(msgspec.structs.replace(response, reason=str(unsaved), why=unsaved))

    def _take_opening(self, request: SceneRequest) -> None:
        """Who grips says how far the jaws are apart: what is planned next must not wait for their next state."""
        edit = request.edit
        if isinstance(edit, SceneGrip | SceneRelease) and edit.opening is not None and self._apart is not None:
            said = GripperState(known=True, position=edit.opening)
            self._apart = jaws_apart(self._arm, said)

    def _tell_what_touches_here(self, contacts: Encoded[Contacts]) -> None:
        """After an edit: what touches where the arm stands; what a refused plan has shown was of another scene."""
        is_touching = bool(contacts.message.contacts)
        if is_touching or self._is_touching:
            self._contacts.put(contacts)
        self._is_touching = is_touching

    def _prepared(self, scene: PlanningScene) -> Showing:
        """Everything that is shown of `scene`; raises `SceneError`, `ValueError` where it cannot be."""
        meshes = {
            digest: encoded(SceneMesh(digest=digest, data=content)) for digest, content in meshes_in(scene).items()
        }
        return Showing(self._built(scene), self._built(scene), encoded(by_digest(scene)), meshes)

    def _prepared_edit(self, scene: PlanningScene) -> Showing:
        showing = self._prepared(scene)
        return replace(showing, contacts=self._contacts_here(showing.world))

    def _contacts_here(self, world: World) -> Encoded[Contacts]:
        configuration, now = self._configuration(), self._node.now()
        touching = () if configuration is None else tuple(world.contacts(configuration))
        if configuration is None or not touching:
            return encoded(Contacts(stamp=now))
        return encoded(Contacts(stamp=now, name=self._arm.joint_names, position=configuration, contacts=touching))

    def _built(self, scene: PlanningScene) -> World:
        return World(self._arm, self._kinematics, self._with_jaws(scene), self._folders)

    def _with_jaws(self, scene: PlanningScene) -> PlanningScene:
        jaws = () if self._apart is None else jaw_objects(self._arm, self._apart)
        return msgspec.structs.replace(scene, objects=(*scene.objects, *jaws))

    def _show(self, showing: Showing) -> None:
        """Tells the planner and the bus: the files of meshes before the scene that names them."""
        self._take_worlds(showing)
        for digest in showing.meshes.keys() - self._shown:
            self._node.publisher(scene_mesh(digest)).put(showing.meshes[digest])
        self._publish(showing.message)
        for digest in self._shown - showing.meshes.keys():
            self._node.unpublish(scene_mesh(digest))
        self._shown = set(showing.meshes)

    def _take_worlds(self, showing: Showing) -> None:
        self.world = showing.world
        self._on_world(showing.world_of_plans)

    def _publish(self, scene: Encoded[PlanningScene]) -> None:
        self._published.append(scene.message)
        self._scene.put(scene)

    def _configuration(self) -> Vector | None:
        """Where the arm stands, or None without a fresh joint state of all joints."""
        return standing(self._arm, self._states.message, self._states.age())

    def _save(self, scene: PlanningScene) -> Reason | None:
        """What went wrong; the scene is changed nevertheless, and saved as soon as that is possible."""
        try:
            save_scene(self._file, scene)
        except OSError as error:
            self._is_unsaved = True
            self._node.unwritten.failed(self._what, error)
            return because("scene.unsaved", file=str(self._file), detail=error.strerror or str(error))
        self._is_unsaved = False
        self._node.unwritten.written(self._what)
        return None

    def _save_again(self) -> None:
        if self._is_unsaved:
            self._save(self._store.scene)

    def _restored(self) -> PlanningScene:
        """The scene of the file as far as it can be; what cannot is said, and its file kept."""
        try:
            scene = load_scene(self._file) or PlanningScene()
        except DamagedScene as error:
            self._node.log.error(f"{error}; it lies in {put_aside(self._file)} now, and NOTHING is around the arm")
            return PlanningScene()
        usable, reasons = usable_part(self._arm, scene, self._folders)
        if reasons:
            aside = put_aside(self._file)
            self._node.log.error(f"left out of the scene, as {aside} still has it: {'; '.join(map(str, reasons))}")
            usable = msgspec.structs.replace(usable, epoch=drawn_epoch(self._node.clock))
            self._save(usable)
        return usable
