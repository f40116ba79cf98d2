"""The cameras on the page: the newest image of each with what is detected in it; a click chooses a thing."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from gemelo.schemas.detections import Detection
from gemelo.services.panel.model.cameras import NONE, Picture
from gemelo.services.panel.model.pointing import Pointed
from gemelo.services.panel.view.browser import CAMERA_MARK, Click
from gemelo.services.panel.view.kit import Kit, esc, note, set_if_new
from gemelo.services.panel.view.pick_box import PickBox

CHOSEN, OTHER = "#ff9f1a", "#ffffff"
LABEL = 0.024  # of the image's width: height of a name in it


class CameraBox:
    """Below the scene; with `PickBox` where the cell has things and places."""

    def __init__(self, kit: Kit) -> None:
        self._kit = kit
        self._cameras, picks = kit.operator.cameras, kit.operator.picks
        self._things = picks.things
        self._images: dict[str, viser.GuiHtmlHandle] = {}
        self._said: dict[str, viser.GuiHtmlHandle] = {}
        for name in self._cameras.names:
            self._images[name], self._said[name] = kit.line(), kit.line()
        self._shown: dict[str, tuple[Picture, str]] = {}
        self._click: Click | None = None
        self.picks = PickBox(kit) if picks.things and picks.places else None

    def point(self, click: Click) -> None:
        """Somebody has clicked into an image; `refresh` takes it up. Any thread may call it."""
        self._click = click

    def refresh(self) -> None:
        """The newest images, what a click has chosen, and what the pick is at."""
        click, self._click = self._click, None
        if click is not None and click.camera in self._images and self.picks is not None:
            self._take_up(click, self.picks)
        chosen = self.picks.thing if self.picks is not None else ""
        for name, line in self._images.items():
            picture = self._cameras.picture(name)
            if picture is not NONE and self._shown.get(name) != (picture, chosen):
                self._shown[name] = picture, chosen
                line.content = image_html(name, picture, chosen, self._caption(name))
        if self.picks is not None:
            self.picks.refresh()

    def _caption(self, camera: str) -> str:
        return f"{camera}: {self._kit.words('click_a_thing')}" if self.picks is not None else camera

    def _take_up(self, click: Click, picks: PickBox) -> None:
        pointed = self._cameras.pointed_at(click.camera, click.x, click.y, self._things)
        if pointed.name:
            picks.choose(pointed.name)
        for name, line in self._said.items():
            said = note(esc(self._sentence(pointed))) if name == click.camera else ""
            set_if_new(line, "content", said)

    def _sentence(self, pointed: Pointed) -> str:
        words = self._kit.words
        if pointed.name:
            return words("pointed_chosen", name=pointed.name)
        if pointed.other:
            return words("pointed_other", name=pointed.other)
        if pointed.nearest:
            return words("pointed_nothing", name=pointed.nearest, away=f"{pointed.away:.0f}")
        return words("pointed_none")


def image_html(camera: str, picture: Picture, chosen: str, caption: str) -> str:
    """The image with the outlines of what is detected; the script of the page tells of clicks on it."""
    view = f"0 0 {picture.width} {picture.height}"
    outlines = "".join(_outline(item, item.name == chosen, picture.width) for item in picture.items)
    drawing = "position:absolute;left:0;top:0;width:100%;height:100%;pointer-events:none"
    return (
        f'<div style="position:relative"><img src="{esc(picture.address)}" {CAMERA_MARK}="{esc(camera)}" '
        f'draggable="false" style="width:100%;display:block;cursor:pointer" alt="{esc(camera)}">'
        f'<svg viewBox="{view}" preserveAspectRatio="none" style="{drawing}">{outlines}</svg></div>'
        f"{note(esc(caption))}"
    )


def _outline(item: Detection, is_chosen: bool, width: int) -> str:
    """Its corners joined, and its name beside the lowest one: dark below light, seen on any image."""
    if not item.corners:
        return ""
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in _pairs(item.corners))
    x, y = max(_pairs(item.corners), key=lambda corner: corner[1])
    colour, line = (CHOSEN, 3) if is_chosen else (OTHER, 1)
    shape = f'<polygon points="{points}" fill="none" vector-effect="non-scaling-stroke"'
    size = LABEL * width
    return (
        f'{shape} stroke="#000" stroke-width="{line + 2}" opacity="0.6"/>'
        f'{shape} stroke="{colour}" stroke-width="{line}"/>'
        f'<text x="{x:.1f}" y="{y + 1.1 * size:.1f}" text-anchor="middle" font-size="{size:.1f}" fill="{colour}" '
        f'stroke="#000" stroke-width="{size / 5:.1f}" paint-order="stroke">{esc(item.name)}</text>'
    )


def _pairs(corners: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    return [(corner[0], corner[1]) for corner in corners]
