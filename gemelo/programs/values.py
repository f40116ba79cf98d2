"""Checks of a step's numbers without a robot: finite, plausible, in the right unit, free of contradiction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from gemelo.api.errors import BadArgument
from gemelo.api.targets import FASTEST, point, quaternion, turned, vector
from gemelo.programs.steps import Arc, Line, MotionStep, Play, Repeat, Speed, Step, Wait, WaitFor, goal_of
from gemelo.schemas.reasons import Reason, because, remedy

Wrong = tuple[str, Reason]  # the key, and what is wrong with it

LONGEST = 86_400.0  # [s] that a step may wait
MOST_ROUNDS = 1_000_000  # of a repeat
MOST_STEPS = 2_000  # of a program, those of its repeats included
DEEPEST = 8  # repeats within one another, and calls within one another
WIDEST_BLEND = 1.0  # [m]
FASTEST_PLAYED = 10.0  # times as fast as a demonstration was shown


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
        case Play():
            if not 0.0 < step.share <= FASTEST_PLAYED:
                yield "share", because("demonstration.speed", value=step.share, most=FASTEST_PLAYED)
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
            yield "joints", because("program.joint.not_finite", joint=name, value=value)
    yield from _turned(step)
    yield from _within("blend", step.blend, 0.0, WIDEST_BLEND, "m")
    if step.frame and step.offset is None:
        yield "frame", because("program.frame.alone", frame=step.frame)
    if isinstance(step, Line | Arc):
        yield from _within("tool_speed", step.tool_speed, 0.0, FASTEST, "m/s")
    if isinstance(step, Arc):
        yield from _arc(step)


def _goal(step: MotionStep) -> Iterator[Wrong]:
    try:
        goal_of(step)
    except BadArgument as error:
        yield "", error.reason


def _turned(step: MotionStep) -> Iterator[Wrong]:
    given = [name for name in ("orientation", "rpy", "along") if getattr(step, name) is not None]
    if given and step.position is None:
        yield given[0], because("program.turn.position", key=given[0])
    if len(given) > 1:
        yield given[1], because("program.turn.several", keys=tuple(given))
    if step.orientation is not None:
        yield from _tried("orientation", partial(quaternion, "orientation", step.orientation))
    if step.rpy is not None:
        yield from _tried("rpy", partial(turned, "rpy", step.rpy))
    if step.along is not None:
        yield from _tried("along", partial(vector, "along", step.along, 3, "a direction"))
        if not any(step.along):
            yield "along", because("program.turn.no_direction")


def _arc(step: Arc) -> Iterator[Wrong]:
    if (step.through is None) == (step.center is None):
        yield "through", because("program.arc.by")
    if step.joints or step.state:
        yield "", because("program.arc.goal")


def _wait_for(step: WaitFor) -> Iterator[Wrong]:
    yield from _within("timeout", step.timeout, 0.0, LONGEST, "s")
    if (step.above is None) == (step.below is None):
        yield "above", because("program.wait_for.bound")
    for name, value in (("above", step.above), ("below", step.below)):
        if value is not None and not math.isfinite(value):
            yield name, because("program.value.not_finite", key=name, value=value)


def _share(share: float) -> Iterator[Wrong]:
    if not 0.0 < share <= 1.0:
        yield "share", because("program.speed.share", value=share)


def _repeat(step: Repeat) -> Iterator[Wrong]:
    if not 1 <= step.count <= MOST_ROUNDS:
        yield "count", because("program.repeat.count", value=step.count, limit=MOST_ROUNDS)
    if not step.steps:
        yield "steps", because("program.repeat.empty")


def _within(name: str, value: float, least: float, most: float, unit: str) -> Iterator[Wrong]:
    if not math.isfinite(value):
        yield name, because("program.value.not_finite", key=name, value=value)
    elif not least <= value <= most:
        thousandth = unit.startswith("m") and least <= value / 1000.0 <= most
        hint = (remedy("write_millimetres", text=f"{value:g}m{unit}"),) if thousandth else ()
        yield name, because("program.value.range", *hint, key=name, value=value, least=least, most=most, unit=unit)


def _tried(name: str, check: Callable[[], object]) -> Iterator[Wrong]:
    """What a check of an argument of the API says, in the words of a file."""
    try:
        check()
    except BadArgument as error:
        yield name, error.reason
