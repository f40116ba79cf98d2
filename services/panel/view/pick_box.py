"""Picking on the page: which thing, to which place, and how it goes; below the images, where a click chooses."""

from __future__ import annotations

from gemelo.services.panel.view.kit import Kit, esc, note, set_if_new


class PickBox:
    """Of a cell with things and places."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._picks = kit, kit.operator.picks
        words, picks = kit.words, kit.operator.picks
        with kit.gui.add_folder(words("picking")):
            self._thing = kit.gui.add_dropdown(words("name_thing"), picks.things)
            self._place = kit.gui.add_dropdown(words("name_place"), picks.places)
            kit.button(words("look"), picks.look, color="gray")
            kit.button(words("pick_this"), self._pick, color="green", needs="move")
            self._lines = kit.line()
            kit.reasons(move=words("pick_this"))

    @property
    def thing(self) -> str:
        """The one that is chosen."""
        return str(self._thing.value)

    def choose(self, thing: str) -> None:
        """One of the cell's things."""
        set_if_new(self._thing, "value", thing)

    def refresh(self) -> None:
        """What was seen, or what the pick is at."""
        set_if_new(self._lines, "content", note("<br>".join(map(esc, map(self._kit.words.line, self._picks.lines)))))

    def _pick(self) -> None:
        self._kit.operator.forget_problem()
        self._picks.pick(self.thing, str(self._place.value))
