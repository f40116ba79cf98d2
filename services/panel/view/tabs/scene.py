"""The tab that edits the planning scene: add, drag, resize, attach, detach, remove, save, load."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import viser

import gemelo
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, CylinderShape, SceneObject, Shape, SphereShape
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.browser import LARGEST_UPLOAD
from gemelo.services.panel.view.kit import Kit, esc, note, set_if_new
from gemelo.services.panel.view.world import DrawnWorld
from gemelo.services.panel.words.words import Words

SIZE = (40.0, 40.0, 40.0)  # [mm] of a new object
FOLDER = Path("scenes")
SHAPES = ("box", "sphere", "cylinder")


class SceneTab:
    """One object at a time is chosen, and can be dragged by its gizmo."""

    def __init__(self, kit: Kit, world: DrawnWorld) -> None:
        self._kit, self._operator, self._world = kit, kit.operator, world
        words, gui, scene = kit.words, kit.gui, kit.operator.arm.scene
        self._names: tuple[str, ...] = ()
        self._shown: SceneObject | None = None
        self.gizmo: viser.TransformControlsHandle | None = None
        self.chosen = gui.add_dropdown(words("object"), (words("none"),))
        self.chosen.on_update(lambda event: self._choose() if event.client_id is not None else None)
        self.facts = kit.line()
        self.size = gui.add_vector3(words("size_mm"), SIZE, min=(0.1, 0.1, 0.1), step=1.0)
        self.at = gui.add_vector3(words("at_mm"), (250.0, 150.0, 20.0), step=1.0)
        kit.button(words("apply"), self._apply, color="blue")
        kit.button(words("attach"), self._attach, color="gray")
        kit.button(words("detach"), lambda: self._with_chosen(scene.detach), color="gray")
        kit.button(words("remove"), lambda: self._with_chosen(scene.remove), color="orange")
        with gui.add_folder(words("new_object")):
            self.name = gui.add_text(words("name"), "box_1")
            self.shape = gui.add_dropdown(words("shape"), tuple(words(shape) for shape in SHAPES))
            kit.button(words("add"), self._add, color="green")
            self.unit = gui.add_dropdown(words("mesh_unit"), ("mm", "m"))
            upload = gui.add_upload_button(words("upload"), mime_type=".stl")
            upload.on_upload(lambda event: self._upload(event.target.value))
        with gui.add_folder(words("file"), expand_by_default=False):
            self.saved = gui.add_dropdown(words("saved_scenes"), (words("choose"), *saved_scenes()))
            self.saved.on_update(lambda event: self.take_name() if event.client_id is not None else None)
            self.file = gui.add_text(words("file_name"), "cell.json")
            kit.button(words("save"), self.save, color="gray")
            kit.button(words("load"), lambda: scene.load(self.path()), color="gray")
            kit.button(words("clear"), scene.clear, color="red")

    def refresh(self, readings: Readings) -> None:
        """The list of objects, and the gizmo of the chosen one."""
        objects = {item.name: item for item in self._operator.bus.scene.objects}
        names = tuple(objects)
        if names != self._names:
            self._names = names
            chosen = self.chosen.value if self.chosen.value in names else self._kit.words("none")
            self.chosen.options = (self._kit.words("none"), *names)
            set_if_new(self.chosen, "value", chosen)
        item = objects.get(self.chosen.value)
        if item != self._shown:
            self._shown = item
            self._show(item)

    def close(self) -> None:
        """Takes its gizmo away."""
        if self.gizmo is not None:
            self.gizmo.remove()
            self.gizmo = None

    def _choose(self) -> None:
        self._shown = None

    def _show(self, item: SceneObject | None) -> None:
        self.close()
        set_if_new(self.facts, "content", "" if item is None else note(esc(self._about(item))))
        if item is None:
            return
        set_if_new(self.size, "value", _size_of(item.shape) or SIZE)
        if len(item.pose.translation) == 3:
            x, y, z = (1000.0 * value for value in item.pose.translation)
            set_if_new(self.at, "value", (x, y, z))
            if not item.attached:
                self.gizmo = self._make_gizmo(item)

    def _about(self, item: SceneObject) -> str:
        carried = self._kit.words("carried_by", link=item.frame) if item.attached else self._kit.words("stands")
        return f"{item.name}: {self._kit.words(str(type(item.shape).__struct_config__.tag))}, {carried}"

    def _make_gizmo(self, item: SceneObject) -> viser.TransformControlsHandle:
        """For this browser alone; the object moves when it is let go."""
        a, b, c, w = item.pose.rotation
        x, y, z = item.pose.translation
        gizmo = self._kit.client.scene.add_transform_controls(
            "/object_gizmo", scale=0.12, position=(x, y, z), wxyz=(w, a, b, c), depth_test=False
        )

        @gizmo.on_update
        def _(event: viser.TransformControlsEvent) -> None:
            if event.phase != "end":
                return
            at = [float(value) for value in event.target.position]
            w, a, b, c = (float(value) for value in event.target.wxyz)
            self._operator.guarded(lambda: self._operator.arm.scene.move(item.name, at, (a, b, c, w)))

        return gizmo

    def _with_chosen(self, action: Callable[[str], object]) -> None:
        name = self._require_chosen()
        action(name)

    def _require_chosen(self) -> str:
        if self.chosen.value not in self._names:
            raise gemelo.BadArgument(self._kit.words("choose_object"))
        return str(self.chosen.value)

    def _attach(self) -> None:
        """To the tool, whose neighbours it may touch."""
        arm = self._operator.arm
        holders = [joint.parent for joint in arm.description.model.joints if joint.child == arm.tool_frame]
        self._with_chosen(lambda name: arm.scene.attach(name, to=arm.tool_frame, touch=holders))

    def _apply(self) -> None:
        name, scene = self._require_chosen(), self._operator.arm.scene
        item = scene.objects[name]
        shape = _resized(item.shape, self.size.value)
        at = tuple(value / 1000.0 for value in self.at.value)  # read before the fields are written for the new size
        if shape != item.shape:
            scene.resize(name, shape)
        if at != item.pose.translation and not item.attached:
            scene.move(name, at, item.pose.rotation or Transform().rotation)

    def _add(self) -> None:
        kind = SHAPES[[self._kit.words(shape) for shape in SHAPES].index(self.shape.value)]
        scene, (x, y, z) = self._operator.arm.scene, (value / 1000.0 for value in self.size.value)
        at = tuple(value / 1000.0 for value in self.at.value)
        name = self._free_name(self.name.value.strip() or kind)
        match kind:
            case "box":
                scene.add_box(name, (x, y, z), at)
            case "sphere":
                scene.add_sphere(name, x / 2.0, at)
            case "cylinder":
                scene.add_cylinder(name, x / 2.0, z, at)
        self._added(name)

    def _added(self, name: str) -> None:
        self.chosen.options = (self._kit.words("none"), *self._names, name)
        self._names = (*self._names, name)
        set_if_new(self.chosen, "value", name)

    def _free_name(self, name: str) -> str:
        """The name, or the same with a number: adding never replaces without a word."""
        taken, number = set(self._operator.arm.scene.objects), 2
        found = name
        while found in taken:
            found, number = f"{name}_{number}", number + 1
        return found

    def _upload(self, file: viser.UploadedFile) -> None:
        """An STL file from the browser."""

        def add() -> None:
            require_small(len(file.content), self._kit.words)
            name = self._free_name(Path(file.name).stem[:64] or "mesh")
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "mesh.stl"
                path.write_bytes(file.content)
                scale = 0.001 if self.unit.value == "mm" else 1.0
                self._operator.arm.scene.add_mesh(name, path, tuple(v / 1000.0 for v in self.at.value), scale=scale)
            self._added(name)

        self._operator.guarded(add)

    def take_name(self) -> None:
        """Of the saved scene that is chosen, into the field."""
        if self.saved.value != self._kit.words("choose"):
            set_if_new(self.file, "value", self.saved.value)

    def save(self) -> None:
        """The scene into the file that the field names."""
        self._operator.arm.scene.save(self.path())
        self.saved.options = (self._kit.words("choose"), *saved_scenes())

    def path(self) -> Path:
        """A file of the folder `scenes`, by its name alone."""
        name = self.file.value.strip()
        if not name or Path(name).name != name or "\0" in name or name.startswith("."):
            raise gemelo.BadArgument(self._kit.words("bad_file_name", name=name))
        FOLDER.mkdir(exist_ok=True)
        return FOLDER / (name if name.endswith(".json") else f"{name}.json")


def saved_scenes() -> tuple[str, ...]:
    """The names of the files that can be loaded."""
    return tuple(sorted(path.name for path in FOLDER.glob("*.json")))


def require_small(size: int, words: Words) -> None:
    """Raises `BadArgument` for a file of so many bytes that the planner would not take its mesh."""
    if size > LARGEST_UPLOAD:
        raise gemelo.BadArgument(words("too_large", size=size // 1_000_000, most=LARGEST_UPLOAD // 1_000_000))


def _size_of(shape: Shape) -> tuple[float, float, float] | None:
    """[mm] edges of the shape's box, None where it has none of its own."""
    match shape:
        case BoxShape(size=(x, y, z)):
            return 1000.0 * x, 1000.0 * y, 1000.0 * z
        case SphereShape(radius=radius):
            return (2000.0 * radius,) * 3
        case CylinderShape(radius=radius, length=length):
            return 2000.0 * radius, 2000.0 * radius, 1000.0 * length
    return None


def _resized(shape: Shape, size: tuple[float, float, float]) -> Shape:
    """The shape in a box of `size` [mm]."""
    x, y, z = (value / 1000.0 for value in size)
    match shape:
        case BoxShape():
            return BoxShape(size=(x, y, z))
        case SphereShape():
            return SphereShape(radius=x / 2.0)
        case CylinderShape():
            return CylinderShape(radius=x / 2.0, length=z)
    return shape
