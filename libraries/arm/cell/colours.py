"""The colours that a thing can be told by: what each name means, and which of them a colour in an image is."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence

from gemelo.schemas.cell import Colour

Rgb = tuple[int, int, int]  # 0 to 255
RGB: dict[Colour, Rgb] = {
    Colour.RED: (205, 35, 35),
    Colour.ORANGE: (235, 125, 20),
    Colour.YELLOW: (235, 210, 40),
    Colour.GREEN: (45, 150, 60),
    Colour.BLUE: (35, 80, 200),
    Colour.PURPLE: (130, 50, 160),
}


def nearest_colour(rgb: Sequence[float]) -> Colour:
    """The name whose hue is nearest to that of `rgb` (3,), 0 to 255: light and dark do not count."""
    hue = _hue(rgb)

    def distance(colour: Colour) -> float:
        off = abs(hue - _hue(RGB[colour]))
        return min(off, 1.0 - off)

    return min(RGB, key=distance)


def _hue(rgb: Sequence[float]) -> float:
    """Of the circle of colours, 0 to 1."""
    red, green, blue = (float(value) / 255.0 for value in rgb)
    return colorsys.rgb_to_hsv(red, green, blue)[0]
