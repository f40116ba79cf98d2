"""The tab that teaches points: this pose under a name, with a picture, to go to, overwrite, rename and forget."""

from __future__ import annotations

import io
from itertools import count

import imageio.v3 as imageio
import numpy as np

import gemelo
from gemelo.services.panel.model.problems import problem_of
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.model.units import text_of
from gemelo.services.panel.view.kit import Kit, box, esc, note, set_if_new, table

PICTURE = (180, 240)  # [pixels] height, width
TO_DRAW = 5.0  # [s] that a browser may take for a picture
BLANK = np.full((*PICTURE, 3), 128, dtype=np.uint8)


class TeachTab:
    """One point at a time is chosen."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._operator, self._teaching = kit, kit.operator, kit.operator.teaching
        words, gui = kit.words, kit.gui
        self._version = -1
        self._names: tuple[str, ...] = ()
        self._shown = ""
        self.name = gui.add_text(words("name"), self._free_name())
        kit.button(words("remember"), self.remember, color="green")
        self.chosen = gui.add_dropdown(words("point"), (words("none"),))
        self.chosen.on_update(lambda event: self._show())
        self.picture = gui.add_image(BLANK, visible=False)
        self.facts = kit.line()
        kit.button(words("go_there"), self._go, color="green", needs="move")
        kit.button(words("as_goal"), self._as_goal, color="blue")
        kit.button(words("overwrite"), lambda: self._take(overwrite=self._require()), color="orange")
        kit.button(words("rename"), lambda: self._teaching.rename_point(self._require(), self.name.value), color="gray")
        kit.button(words("remove"), self.remove, color="red")
        kit.reasons(move=words("go_there"))

    def refresh(self, readings: Readings) -> None:
        """The list of points."""
        if self._teaching.version == self._version:
            return
        is_first, self._version = self._version < 0, self._teaching.version
        self._list(chooses_new=not is_first)

    def _list(self, chooses_new: bool) -> None:
        """All points to choose from, and what is known of the chosen one."""
        names = tuple(self._teaching.points)
        if names != self._names:
            fresh = [name for name in names if name not in self._names]
            chosen = fresh[-1] if fresh and chooses_new else self.chosen.value
            self._names = names
            self.chosen.options = (self._kit.words("none"), *names)
            set_if_new(self.chosen, "value", chosen if chosen in names else self._kit.words("none"))
        self._shown = ""
        self._show()

    def remember(self) -> None:
        """Where the arm is now, under the name in the field, and chooses it."""
        self._take()
        self._list(chooses_new=True)  # at once: what is pressed next is meant for it
        set_if_new(self.name, "value", self._free_name())

    def _free_name(self) -> str:
        """The first that no point has."""
        names = (self._kit.words("point_name", number=number) for number in count(1))
        return next(name for name in names if name not in self._teaching.points)

    def _take(self, overwrite: str = "") -> None:
        self._teaching.remember(overwrite or self.name.value, self._drawn, overwrite=bool(overwrite))

    def _drawn(self) -> bytes | None:
        """What this browser sees, as JPEG; None where it does not draw in time."""
        try:
            seen = self._kit.client.get_render(*PICTURE, timeout=TO_DRAW)
        except (TimeoutError, RuntimeError):
            return None
        file = io.BytesIO()
        imageio.imwrite(file, seen[:, :, :3], extension=".jpg")
        return file.getvalue()

    def _require(self) -> str:
        if self.chosen.value not in self._names:
            raise gemelo.BadArgument(self._kit.words("choose_point"))
        return str(self.chosen.value)

    def remove(self) -> None:
        """The chosen point; asks first: what is forgotten cannot be had back."""
        name, words = self._require(), self._kit.words
        with self._kit.gui.add_modal(words("remove")) as modal:
            self._kit.line(note(esc(words("remove_question", name=name))))

            def remove() -> None:
                modal.close()
                self._operator.guarded(lambda: self._teaching.remove_point(name))

            self._kit.button(words("remove_point"), remove, color="red")
            self._kit.button(words("cancel"), modal.close, color="gray")

    def _as_goal(self) -> None:
        self._operator.set_goal(self._teaching.points[self._require()].joints)

    def _go(self) -> None:
        self._as_goal()
        self._operator.motions.ask()
        self._operator.plan_and_execute()

    def _show(self) -> None:
        """The joint values and the picture of the chosen point."""
        name = str(self.chosen.value)
        if name == self._shown:
            return
        self._shown = name
        point = self._teaching.points.get(name)
        picture = point.picture if point is not None else None
        is_there = picture is not None and picture.is_file()
        if picture is not None and is_there:
            self.picture.image = np.asarray(imageio.imread(picture))
        set_if_new(self.picture, "visible", is_there)
        joints = self._operator.arm.description.joints
        rows = [(esc(joint.name), esc(text_of(joint, point.joints[joint.name]))) for joint in joints] if point else []
        about = table(rows) if rows else note(esc(self._kit.words("no_points"))) if not self._names else ""
        error = self._teaching.points_error
        if error is not None:
            about = box(esc(self._kit.words.problem(problem_of(error))[1]), "#e03131")
        set_if_new(self.facts, "content", about)
