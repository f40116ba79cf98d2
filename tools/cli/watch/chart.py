"""Curves over time as text: a panel of braille dots, two by four to a character, with both axes. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gemelo.schemas.plain_text import escaped
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.language import sentence

BLANK = 0x2800  # the braille character without a dot; each dot is a bit of its number
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # of a character, by row and column
ACROSS, DOWN = 2, 4  # dots of a character
COLOURS = (36, 33, 35, 32, 34, 31, 96, 93)  # of the terminal, one curve after the other
LABEL = 10  # columns of the numbers on the vertical axis
TICK_ROWS, TICK_COLUMNS = 3, 12  # between two numbers of an axis at least
HEADROOM = 0.05  # of the span, above and below the curves
FLAT = 1e-3  # of a value, the least span around it


class ChartCurve(NamedTuple):
    """One number over time; what is not finite is a gap."""

    name: str
    points: Sequence[tuple[float, float]]  # [s], value

    @property
    def values(self) -> list[float]:
        """The finite ones, in the unit of the curve."""
        return [value for _, value in self.points if math.isfinite(value)]


def chart(
    curves: Sequence[ChartCurve],
    start: float,
    end: float,
    columns: int,
    rows: int,
    unit: str = "",
    is_coloured: bool = False,
) -> str:
    """A panel of at most `columns` x (`rows` + 2 + one line for each curve) from `start` to `end` [s]; `unit` as "rad",
    empty where it is not known. Times on the axis count from `end`."""
    values = [value for curve in curves for value in curve.values]
    lines = [_headline(curve, unit, _colour(index) if is_coloured else "") for index, curve in enumerate(curves)]
    if not values:
        return "\n".join(lines)
    low, high = _span(min(values), max(values))
    width = max(columns - LABEL - 2, TICK_COLUMNS)
    cells: dict[tuple[int, int], tuple[int, int]] = {}  # row, column: the dots, and whose the last one is
    for index, curve in enumerate(curves):
        for x, y in _trace(curve.points, (start, end), (low, high), width * ACROSS, rows * DOWN):
            row, column = y // DOWN, x // ACROSS
            cells[row, column] = cells.get((row, column), (0, 0))[0] | DOTS[y % DOWN][x % ACROSS], index
    ticks = {
        round((high - value) / (high - low) * (rows - 1)): text for value, text in _ticks(low, high, rows // TICK_ROWS)
    }
    for row in range(rows):
        drawn = "".join(_cell(cells.get((row, column)), is_coloured) for column in range(width))
        mark = "┤" if row in ticks else "│"
        lines.append(f"{ticks.get(row, ''):>{LABEL}} {mark}{drawn}".rstrip())
    return "\n".join([*lines, *_time_axis(start - end, width)])


def _headline(curve: ChartCurve, unit: str, colour: str) -> str:
    name = f"{colour}{escaped(curve.name)}\x1b[0m" if colour else curve.name
    of = f" [{unit}]" if unit else ""
    values = curve.values
    if not values:
        return sentence(because("cli.plot.nothing_yet", curve=f"{name}{of}"))
    span = {"value": values[-1], "least": min(values), "most": max(values)}
    return sentence(because("cli.plot.curve", curve=f"{name}{of}", **span))


def _span(low: float, high: float) -> tuple[float, float]:
    """What the vertical axis shows."""
    least = FLAT * max(abs(low), abs(high)) or FLAT
    room = max(HEADROOM * (high - low), (least - (high - low)) / 2.0)
    return low - room, high + room


def _trace(
    points: Sequence[tuple[float, float]],
    times: tuple[float, float],
    values: tuple[float, float],
    across: int,
    down: int,
) -> Iterator[tuple[int, int]]:
    """The dots (column, row) of a curve, neighbours joined."""
    before: tuple[int, int] | None = None
    for time, value in points:
        if not math.isfinite(value) or not times[0] <= time <= times[1]:
            before = None
            continue
        x = round((time - times[0]) / (times[1] - times[0]) * (across - 1))
        y = round((values[1] - value) / (values[1] - values[0]) * (down - 1))
        from_x, from_y = before or (x, y)
        steps = max(abs(x - from_x), abs(y - from_y), 1)
        for step in range(steps + 1):
            yield from_x + round(step * (x - from_x) / steps), from_y + round(step * (y - from_y) / steps)
        before = x, y


def _ticks(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Round numbers from `low` to `high`, about `count` of them."""
    step = _round_step((high - low) / max(count, 2))
    digits = max(0, -math.floor(math.log10(step)))
    many = max(abs(low), abs(high)) >= 1e6 or digits > 6
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    return [(value, f"{value:.4g}" if many else f"{value + 0.0:.{digits}f}") for value in values]


def _round_step(least: float) -> float:
    """The least 1, 2 or 5 times a power of ten that is not below `least`."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least * (1.0 - 1e-9))


def _time_axis(start: float, width: int) -> tuple[str, str]:
    """The line below the curves and its numbers, from `start` [s], which is negative, to 0."""
    line, numbers = ["─"] * width, [" "] * width
    for value, text in _ticks(start, 0.0, width // TICK_COLUMNS):
        column = round((value - start) / -start * (width - 1))
        said = f"{text} s"
        left = min(max(column - len(said) // 2, 0), width - len(said))
        line[column] = "┬"
        numbers[left : left + len(said)] = said
    return f"{'':{LABEL}} └{''.join(line)}", f"{'':{LABEL}}  {''.join(numbers)}".rstrip()


def _cell(drawn: tuple[int, int] | None, is_coloured: bool) -> str:
    if drawn is None:
        return " "
    dots, index = drawn
    letter = chr(BLANK | dots)
    return f"{_colour(index)}{letter}\x1b[0m" if is_coloured else letter


def _colour(index: int) -> str:
    return f"\x1b[{COLOURS[index % len(COLOURS)]}m"
