"""Checks of a step's numbers without a robot: finite, plausible, in the right unit, free of contradiction."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import partial

from gemelo.api.errors import BadArgument
from gemelo.api.targets import FASTEST, point, quaternion, turned, vector
from gemelo.programs.steps import Arc, Line, MotionStep, Repeat, Speed, Step, Wait, WaitFor, goal_of

Wrong = tuple[str, str]  # the key, and what is wrong with it

LONGEST = 86_400.0  # [s] that a step may wait
MOST_ROUNDS = 1_000_000  # of a repeat
MOST_STEPS = 2_000  # of a program, those of its repeats included
DEEPEST = 8  # repeats within one another, and calls within one another
WIDEST_BLEND = 1.0  # [m]


def wrong_values(step: Step) -> Iterator[Wrong]:
    """Every mistake in a step that can be seen without the robot."""
    match step:
        case MotionStep():
            yield from _motion(step)
        case Wait():
            yield from _within("time", step.time, 0.0, LONGEST, "s")
        case WaitFor():
            yield from _wait_for(step)
        case Speed():
            yield from _share(step.share)
        case Repeat():
            yield from _repeat(step)
        case _:
            return


def _motion(step: MotionStep) -> Iterator[Wrong]:
    yield from _goal(step)
    for name in ("position", "offset", "through", "center"):
        values = getattr(step, name, None)
        if values is not None:
            yield from _tried(name, partial(point, name, values))
    for name, value in step.joints.items():
        if not math.isfinite(value):
            yield "joints", f'joint "{name}" is {value}: it must be finite'
    yield from _turned(step)
    yield from _within("blend", step.blend, 0.0, WIDEST_BLEND, "m")
    if step.frame and step.offset is None:
        yield "frame", f'frame = "{step.frame}" says along which axes an offset is: it goes with offset alone'
    if isinstance(step, Line | Arc):
        yield from _within("tool_speed", step.tool_speed, 0.0, FASTEST, "m/s")
    if isinstance(step, Arc):
        yield from _arc(step)


def _goal(step: MotionStep) -> Iterator[Wrong]:
    try:
        goal_of(step)
    except BadArgument as error:
        yield "", str(error)


def _turned(step: MotionStep) -> Iterator[Wrong]:
    given = [name for name in ("orientation", "rpy", "along") if getattr(step, name) is not None]
    if given and step.position is None:
        yield given[0], f"{given[0]} says how the tool is turned at a position: give position too"
    if len(given) > 1:
        yield given[1], f"say how the tool is turned once, not by {' and '.join(given)}"
    if step.orientation is not None:
        yield from _tried("orientation", partial(quaternion, "orientation", step.orientation))
    if step.rpy is not None:
        yield from _tried("rpy", partial(turned, "rpy", step.rpy))
    if step.along is not None:
        yield from _tried("along", partial(vector, "along", step.along, 3, "a direction"))
        if not any(step.along):
            yield "along", "along = [0, 0, 0] is no direction"


def _arc(step: Arc) -> Iterator[Wrong]:
    if (step.through is None) == (step.center is None):
        yield "through", "an arc goes by one of through and center"
    if step.joints or step.state:
        yield "", "an arc is the tool's: give point, position or offset, not joints or a state"


def _wait_for(step: WaitFor) -> Iterator[Wrong]:
    yield from _within("timeout", step.timeout, 0.0, LONGEST, "s")
    if (step.above is None) == (step.below is None):
        yield "above", "a sensor is waited for with one of above and below"
    for name, value in (("above", step.above), ("below", step.below)):
        if value is not None and not math.isfinite(value):
            yield name, f"{name} is {value}: it must be finite"


def _share(share: float) -> Iterator[Wrong]:
    if not 0.0 < share <= 1.0:
        yield "share", f"share = {share * 100.0:g}% is not above 0% and at most 100%"


def _repeat(step: Repeat) -> Iterator[Wrong]:
    if not 1 <= step.count <= MOST_ROUNDS:
        yield "count", f"count = {step.count} is not 1 to {MOST_ROUNDS}"
    if not step.steps:
        yield "steps", "a repeat needs steps: steps = [...]"


def _within(name: str, value: float, least: float, most: float, unit: str) -> Iterator[Wrong]:
    if not math.isfinite(value):
        yield name, f"{name} is {value}: it must be finite"
    elif not least <= value <= most:
        thousandth = unit.startswith("m") and least <= value / 1000.0 <= most
        hint = f': if it is in mm, write "{value:g}m{unit}"' if thousandth else ""
        yield name, f"{name} = {value:g} {unit} is not {least:g} to {most:g} {unit}{hint}"


def _tried(name: str, check: Callable[[], object]) -> Iterator[Wrong]:
    """What a check of an argument of the API says, in the words of a file."""
    try:
        check()
    except BadArgument as error:
        yield name, in_words_of_a_file(str(error).replace(f"{name}= ", f"{name} "))


def in_words_of_a_file(text: str) -> str:
    """`write gemelo.mm(300)` is `write "300mm"` in a file."""
    return re.sub(r"write gemelo\.(mm|deg)\(([^)]*)\)", r'write "\2\1"', text)
