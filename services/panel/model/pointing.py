"""The detected thing that a person points at in a camera's image."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from math import dist, hypot, inf

from gemelo.schemas.detections import Detection

Pixel = Sequence[float]  # (x, y)

NEAR = 0.025  # of the image's width: chosen, what a finger misses a small outline by


@dataclass(frozen=True)
class Pointed:
    """What is meant: a thing by `name`; else nothing, and what is nearest."""

    name: str = ""  # of a thing; empty: none is meant
    other: str = ""  # what was pointed at that is detected and no thing of the cell file
    nearest: str = ""  # the thing nearest to the place
    away: float = inf  # [px] from the place to its outline


def pointed_at(items: Iterable[Detection], things: Collection[str], place: Pixel, near: float) -> Pointed:
    """The thing whose outline is around `place` [px], or is nearest within `near` [px].

    Of several outlines around it the one whose middle is nearest.
    """
    found = [(_away(item.corners, place), _from_middle(item.corners, place), item.name) for item in items]
    (away, _, nearest) = min((each for each in found if each[2] in things), default=(inf, inf, ""))
    if away <= near:
        return Pointed(name=nearest, nearest=nearest, away=away)
    others = [each for each in found if each[2] not in things and each[0] <= near]
    return Pointed(other=min(others)[2] if others else "", nearest=nearest, away=away)


def _from_middle(outline: Sequence[Pixel], place: Pixel) -> float:
    """[px] from the mean of the outline's corners."""
    if not outline:
        return inf
    middle = [sum(corner[axis] for corner in outline) / len(outline) for axis in (0, 1)]
    return dist(middle, place)


def _away(outline: Sequence[Pixel], place: Pixel) -> float:
    """[px] from `place` to the outline; 0 within it, infinite where there is none."""
    sides = list(zip(outline, [*outline[1:], *outline[:1]], strict=True))
    crossed = sum(_is_right_of(place, *side) for side in sides)
    return 0.0 if crossed % 2 else min((_to_side(place, *side) for side in sides), default=inf)


def _is_right_of(place: Pixel, one: Pixel, other: Pixel) -> bool:
    """True if the side crosses the half-line that leaves `place` towards larger x."""
    (x, y), (x1, y1), (x2, y2) = place, one, other
    return (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1)


def _to_side(place: Pixel, one: Pixel, other: Pixel) -> float:
    """[px] to the nearest point of the side."""
    (x, y), (x1, y1), (x2, y2) = place, one, other
    along_x, along_y = x2 - x1, y2 - y1
    length = along_x**2 + along_y**2
    share = 0.0 if length == 0.0 else min(1.0, max(0.0, ((x - x1) * along_x + (y - y1) * along_y) / length))
    return hypot(x - x1 - share * along_x, y - y1 - share * along_y)
