"""A program as a Python script on `gemelo`, which runs by itself and needs no file but those of demonstrations."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence

from gemelo.api.targets import FULL, Waypoint
from gemelo.api.units import Pose
from gemelo.programs.planning import require_point, waypoint_of
from gemelo.programs.points import Point
from gemelo.programs.program import Program
from gemelo.programs.sequence import Leg, called_programs, joins
from gemelo.programs.steps import (
    AnyStep,
    Arc,
    Attach,
    Call,
    Detach,
    Grip,
    Line,
    MotionStep,
    Output,
    Pick,
    Play,
    Repeat,
    Speed,
    Wait,
    WaitFor,
    goal_of,
)

WAIT_FOR = '''def wait_for(
    arm: gemelo.Arm, sensor: str, above: float | None = None, below: float | None = None, timeout: float = 60.0
) -> None:
    """Waits until the sensor reads more than `above` or less than `below`; ends the script after `timeout` [s]."""
    end = time.monotonic() + timeout
    while True:
        value = arm.sensors.get(sensor)
        if value is not None and ((above is not None and value > above) or (below is not None and value < below)):
            return
        if time.monotonic() >= end:
            raise SystemExit(f"sensor {sensor} reads {value} after {timeout:g} s, not above {above} or below {below}")
        time.sleep(0.05)
'''
PLAYED = "from gemelo.programs.demonstrations import demonstrations_of, play_demonstration\n"
INDENT = "    "


def export_script(program: Program, points: Mapping[str, Point], programs: Mapping[str, Program] | None = None) -> str:
    """The text of the script: a function for the program and each that it calls, the joint values of points written in.

    `programs`: those that it calls. Where a repeat ends with a blended motion the script stops, and the program does
    not. Raises `BadArgument` for a point that is not known and for calls in a circle, KeyError for a program.
    """
    called = called_programs(program, programs or {})
    return _Script(points, {program.name: program, **called}).text()


class _Script:
    """`programs`: the one that is exported first, then those that it calls."""

    def __init__(self, points: Mapping[str, Point], programs: Mapping[str, Program]) -> None:
        self._points, self._programs = points, programs
        self._functions = _function_names(list(programs))
        self._steps = [step for each in programs.values() for _, step in each.all_steps()]
        self._name = next(iter(programs))

    def text(self) -> str:
        """The whole script."""
        used = dict.fromkeys(step.point for step in self._steps if isinstance(step, MotionStep) and step.point)
        blocks = [self._head() + ("\n" + "\n".join(self._table(list(used))) + "\n" if used else "")]
        if any(isinstance(step, WaitFor) for step in self._steps):
            blocks.append(WAIT_FOR)
        blocks += ["\n".join(self._function(*each)) + "\n" for each in reversed(list(self._programs.items()))]
        return "\n\n".join([*blocks, self._main()])

    def _head(self) -> str:
        said = f"Program {self._name}, written by `gemelo program export`; m, rad, s."
        needs_time = any(isinstance(step, Wait | WaitFor) for step in self._steps)
        played = PLAYED if any(isinstance(step, Play) for step in self._steps) else ""
        return (
            f'"""{_in_docstring(said)}"""\n\n' + ("import time\n\n" if needs_time else "") + "import gemelo\n" + played
        )

    def _table(self, names: list[str]) -> Iterator[str]:
        yield "POINTS: dict[str, dict[str, float]] = {  # [rad] or [m] by joint"
        for name in names:
            yield f"{INDENT}{_py(name)}: {_py(require_point(self._points, name).joints)},"
        yield "}"

    def _function(self, name: str, program: Program) -> Iterator[str]:
        yield f"def {self._functions[name]}(arm: gemelo.Arm, speed: float) -> None:"
        yield f'{INDENT}"""Program {_in_docstring(name)}; `speed`: share of the joints\' velocity limits."""'
        if program.robot:
            yield f"{INDENT}if arm.name != {_py(program.robot)}:"
            said = _py(f"this is for {program.robot}, and the arm is ")
            yield f"{INDENT * 2}raise SystemExit({said} + arm.name)"
        yield from self._lines(program.steps, INDENT)

    def _main(self) -> str:
        function = self._functions[self._name]
        return f'if __name__ == "__main__":\n{INDENT}with gemelo.connect() as arm:\n{INDENT * 2}{function}(arm, 1.0)\n'

    def _lines(self, steps: Sequence[AnyStep], indent: str) -> Iterator[str]:
        for leg in _legs(steps):
            step = leg[0]
            match step:
                case MotionStep():
                    yield f"{indent}arm.move({', '.join(self._motion(leg))})"
                case Repeat():
                    yield f"{indent}for _ in range({step.count}):"
                    yield from self._lines(step.steps, indent + INDENT)
                case _:
                    yield indent + self._line(step)

    def _line(self, step: AnyStep) -> str:
        match step:
            case Output():
                return f"arm.output({_py(step.name)}, {step.on})"
            case Grip():
                return f"arm.grip({_py(step.to)})"
            case Pick():
                camera = f", camera={_py(step.camera)}" if step.camera else ""
                return f"arm.pick({_py(step.thing)}, to={_py(step.place)}{camera})"
            case Play():
                shown = f"demonstrations_of(arm).require({_py(step.demonstration)})"
                return f"play_demonstration(arm, {shown}, {step.share!r})"
            case Wait():
                return f"time.sleep({step.time!r})"
            case WaitFor():
                given = {"above": step.above, "below": step.below, "timeout": step.timeout}
                said = "".join(f", {name}={value!r}" for name, value in given.items() if value is not None)
                return f"wait_for(arm, {_py(step.sensor)}{said})"
            case Speed():
                return f"speed = {step.share!r}"
            case Attach():
                touch = f", touch={_py(step.touch)}" if step.touch else ""
                link = _py(step.link) if step.link else "arm.tool_frame"
                return f"arm.scene.attach({_py(step.object)}, to={link}{touch})"
            case Detach():
                return f"arm.scene.detach({_py(step.object)})"
            case Call():
                return f"{self._functions[step.program]}(arm, speed)"
        raise AssertionError(step)

    def _motion(self, leg: Sequence[AnyStep]) -> Iterator[str]:
        """The arguments of `arm.move`."""
        *before, last = [step for step in leg if isinstance(step, MotionStep)]
        if before:
            yield f"via=[{', '.join(self._waypoint(step) for step in before)}]"
            yield f"blend={min(step.blend for step in before)!r}"
        yield from self._goal(last)
        if isinstance(last, Line):
            yield "line=True"
        if isinstance(last, Arc):
            yield f"through={last.through!r}" if last.through is not None else f"center={last.center!r}"
        if isinstance(last, Line | Arc) and last.tool_speed > 0.0:
            yield f"tool_speed={last.tool_speed!r}"
        yield "speed=speed"

    def _goal(self, step: MotionStep) -> Iterator[str]:
        match goal_of(step):
            case "point" if isinstance(step, Arc):
                pose = f"arm.fk(POINTS[{_py(step.point)}])"
                is_full = len(require_point(self._points, step.point).joints) >= FULL
                yield f"pose={pose}" if is_full else f"position={pose}.position, along={pose}.axis()"
            case "point":
                yield f"joints=POINTS[{_py(step.point)}]"
            case "state":
                yield f"named={_py(step.state)}"
            case goal:
                yield f"{goal}={_py(getattr(step, goal))}"
        for name in ("orientation", "rpy", "along", "frame"):
            if getattr(step, name):
                yield f"{name}={_py(getattr(step, name))}"

    def _waypoint(self, step: MotionStep) -> str:
        if step.point:
            return f"POINTS[{_py(step.point)}]"
        return _waypoint_text(waypoint_of(step, self._points))


def _legs(steps: Sequence[AnyStep]) -> Iterator[tuple[AnyStep, ...]]:
    """The steps of one list, those that are blended into one another together."""
    held: tuple[AnyStep, ...] = ()
    for step in steps:
        if held and joins(_at_any_speed(held[-1]), _at_any_speed(step)):
            held = (*held, step)
            continue
        if held:
            yield held
        held = (step,)
    if held:
        yield held


def _at_any_speed(step: AnyStep) -> Leg:
    return Leg((step,), ((),), (), 1.0)


def _waypoint_text(waypoint: Waypoint) -> str:
    if isinstance(waypoint, Pose):
        return f"gemelo.Pose({waypoint.position!r}, {waypoint.orientation!r})"
    return _py(waypoint)


def _function_names(names: Sequence[str]) -> dict[str, str]:
    """A name for the function of each program; no two are the same."""
    found: dict[str, str] = {}
    for name in names:
        word = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        plain = f"run_{word}" if word else "run"
        number = 1
        while (chosen := plain if number == 1 else f"{plain}_{number}") in found.values():
            number += 1
        found[name] = chosen
    return found


def _py(value: object) -> str:
    """A value as Python source, texts in double quotes."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_py(key)}: {_py(each)}" for key, each in value.items()) + "}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_py, value))}{',' if len(value) == 1 else ''})"
    return repr(value)


def _in_docstring(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
