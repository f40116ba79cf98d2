"""A program as the sequence of what is to be done: repeats and calls unrolled, blended motions joined into legs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from gemelo.api.errors import BadArgument
from gemelo.programs.program import Program
from gemelo.programs.steps import AnyStep, Call, Go, Line, MotionStep, Repeat, Speed, StepPath, path_text
from gemelo.schemas.reasons import Reason, because

MOST_JOINED = 20  # chosen: motions in one plan; more would keep the arm waiting for it


@dataclass(frozen=True)
class Leg:
    """What is done at once: one step, or motions that are blended into one another."""

    steps: tuple[AnyStep, ...]
    paths: tuple[StepPath, ...]  # of each of them; a called program's steps stand behind its call
    rounds: tuple[int, ...]  # from 0, of every repeat around the first step
    speed: float  # share of the joints' velocity limits

    @property
    def is_motion(self) -> bool:
        return isinstance(self.steps[0], MotionStep)

    @property
    def path(self) -> StepPath:
        """Of its first step."""
        return self.paths[0]


def legs_of(program: Program, programs: Mapping[str, Program], first: StepPath = ()) -> Iterator[Leg]:
    """Everything to be done, in order, from the step `first` on, at the speed that holds there.

    A repeat that `first` leads into begins with its first round. Raises `BadArgument` where there is no such step.
    """
    return _joined(single_legs(program, programs, first))


def single_legs(program: Program, programs: Mapping[str, Program], first: StepPath = ()) -> Iterator[Leg]:
    """The same, a leg for every step."""
    require_step(program, programs, first)
    return _walk(program.steps, (), (), _Speed(1.0), programs, first)


def require_step(program: Program, programs: Mapping[str, Program], path: StepPath) -> None:
    """Raises `BadArgument` where the program has no step there."""
    steps: tuple[AnyStep, ...] = program.steps
    for depth, index in enumerate(path):
        if not 0 <= index < len(steps):
            raise BadArgument(_absent(program.name, path, depth, len(steps)))
        steps = _inner(steps[index], programs)


def _absent(program: str, path: StepPath, depth: int, count: int) -> Reason:
    """`count`: the steps that there are in the step which the first `depth` numbers of `path` lead to."""
    step, around = path_text(path), path_text(path[:depth])
    if around and count:
        return because("program.step.absent_in_step", program=program, step=step, count=count, around=around)
    if around:
        return because("program.step.none_in_step", program=program, step=step, around=around)
    if count:
        return because("program.step.absent_of", program=program, step=step, count=count)
    return because("program.step.none", program=program, step=step)


def called_programs(
    program: Program, programs: Mapping[str, Program], callers: tuple[str, ...] = ()
) -> dict[str, Program]:
    """All programs that it calls, and those that they call, as they are now, by the name in the call.

    Raises `BadArgument` for calls in a circle, KeyError for a program that is not there.
    """
    found: dict[str, Program] = {}
    callers = (*callers, program.name)
    for _, step in program.all_steps():
        if isinstance(step, Call) and step.program not in found:
            if step.program in callers:
                raise BadArgument(because("program.calls.endless", programs=(*callers, step.program)))
            called = programs[step.program]
            found |= {step.program: called, **called_programs(called, programs, callers)}
    return found


def joins(first: Leg, second: Leg) -> bool:
    """True if the arm can pass from one motion into the other without a stop."""
    one, other = first.steps[-1], second.steps[0]
    return (
        isinstance(one, MotionStep)
        and one.blend > 0.0
        and type(one) is type(other)
        and isinstance(other, Go | Line)
        and first.speed == second.speed
        and getattr(one, "tool_speed", 0.0) == getattr(other, "tool_speed", 0.0)
        and not any(isinstance(each, MotionStep) and (each.offset or each.along) for each in (one, other))
    )


def lost_blend(legs: tuple[Leg, ...]) -> dict[StepPath, Reason]:
    """The steps of `legs` whose blend has no effect, and why; the last of `legs` is not judged."""
    notes = {}
    for leg, following in pairwise(legs):
        step = leg.steps[-1]
        if isinstance(step, MotionStep) and step.blend > 0.0 and not joins(leg, following):
            notes[leg.paths[-1]] = because("program.blend.lost")
    return notes


def _joined(legs: Iterator[Leg]) -> Iterator[Leg]:
    held: Leg | None = None
    for leg in legs:
        if held is not None and joins(held, leg) and len(held.steps) < MOST_JOINED:
            held = replace(held, steps=held.steps + leg.steps, paths=held.paths + leg.paths)
            continue
        if held is not None:
            yield held
        held = leg
    if held is not None:
        yield held


class _Speed:
    """The speed that holds in one program; a called one begins with its caller's."""

    def __init__(self, share: float) -> None:
        self.share = share


def _walk(
    steps: tuple[AnyStep, ...],
    around: StepPath,
    rounds: tuple[int, ...],
    speed: _Speed,
    programs: Mapping[str, Program],
    first: StepPath,
) -> Iterator[Leg]:
    begin = first[0] if first else 0
    for step in steps[:begin]:
        _skip(step, speed)
    for index, step in enumerate(steps[begin:], begin):
        path = (*around, index)
        inner = first[1:] if index == begin else ()
        match step:
            case Speed():
                speed.share = step.share
            case Repeat():
                for number in range(step.count):
                    rest = inner if number == 0 else ()
                    yield from _walk(step.steps, path, (*rounds, number), speed, programs, rest)
            case Call():
                called = _inner(step, programs)
                yield from _walk(called, path, rounds, _Speed(speed.share), programs, inner)
            case _:
                yield Leg((step,), (path,), rounds, speed.share)


def _skip(step: AnyStep, speed: _Speed) -> None:
    """What a step that is not carried out leaves behind: its speed."""
    if isinstance(step, Speed):
        speed.share = step.share
    if isinstance(step, Repeat):
        for inner in step.steps:
            _skip(inner, speed)


def _inner(step: AnyStep, programs: Mapping[str, Program]) -> tuple[AnyStep, ...]:
    """The steps of a repeat or of a called program."""
    if isinstance(step, Repeat):
        return step.steps
    if isinstance(step, Call):
        return programs[step.program].steps
    return ()
