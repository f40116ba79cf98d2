"""Checks of a program against this robot: unknown names, values beyond limits, calls in a circle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from gemelo.api.errors import BadArgument, Error
from gemelo.api.gripping import opening_of
from gemelo.api.targets import joint_state
from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.names import program_name, read_text
from gemelo.programs.points import Point
from gemelo.programs.program import Program
from gemelo.programs.reading import parse_program, value_mistakes
from gemelo.programs.steps import AnyStep, Attach, Call, Grip, MotionStep, Output, Pick, WaitFor
from gemelo.programs.values import DEEPEST, Wrong, in_words_of_a_file

PointsByName = Mapping[str, Point]
ProgramsByName = Mapping[str, Program]


def find_mistakes(
    program: Program, robot: ArmDescription, points: PointsByName, programs: ProgramsByName
) -> tuple[Mistake, ...]:
    """All mistakes of a program and of those that it calls, in the order of each file; empty if it can be planned."""
    return tuple(_Search(robot, points, programs).of(program, (program.name,)))


def require_right(program: Program, robot: ArmDescription, points: PointsByName, programs: ProgramsByName) -> None:
    """Raises `ProgramError` with all mistakes, if there are any."""
    if found := find_mistakes(program, robot, points, programs):
        raise ProgramError(found)


def find_mistakes_in_file(
    path: Path, robot: ArmDescription, points: PointsByName, programs: ProgramsByName
) -> tuple[Mistake, ...]:
    """The same for a file, those of its form included: whatever can be seen at once."""
    try:
        program, mistakes = parse_program(path.name.removesuffix(".toml"), read_text(path), path)
    except ProgramError as error:
        return error.mistakes
    except Error as error:
        return (Mistake(str(path), 0, (), str(error).removeprefix(f"{path} ")),)
    found = {*mistakes, *find_mistakes(program, robot, points, programs)}
    return tuple(sorted(found, key=lambda each: (each.file != str(path), each.file, each.line, each.step)))


class _Search:
    def __init__(self, robot: ArmDescription, points: PointsByName, programs: ProgramsByName) -> None:
        self._robot, self._points, self._programs = robot, points, programs
        self._seen: set[str] = set()

    def of(self, program: Program, callers: tuple[str, ...]) -> Iterator[Mistake]:
        """`callers`: from the first program to this one."""
        if program.name in self._seen:
            return
        self._seen.add(program.name)
        mistakes = value_mistakes(program)
        if program.robot and program.robot != self._robot.name:
            what = f'it is for robot "{program.robot}", and this one is "{self._robot.name}": correct robot = ...'
            mistakes.append(program.mistake((), "robot", what))
        called: list[Mistake] = []
        for path, step in program.all_steps():
            mistakes += [program.mistake(path, *wrong) for wrong in self._wrong(step)]
            if isinstance(step, Call):
                try:
                    called += self._call(step, callers)
                except BadArgument as error:
                    mistakes.append(program.mistake(path, "program", str(error)))
        yield from sorted(mistakes, key=lambda each: (each.line, each.step))
        yield from called

    def _wrong(self, step: AnyStep) -> Iterator[Wrong]:
        robot = self._robot
        match step:
            case MotionStep():
                yield from self._motion(step)
            case Output():
                yield from _unknown("name", "output", step.name, [each.name for each in robot.outputs], robot)
            case Grip():
                yield from self._grip(step)
            case Pick():
                if robot.gripper is None:
                    yield "thing", f"{robot.name} has no gripper: write a [gripper] into its robot.toml"
            case WaitFor():
                yield from _unknown("sensor", "sensor", step.sensor, [each.name for each in robot.sensors], robot)
            case Attach():
                for key, link in (("link", step.link), *(("touch", each) for each in step.touch)):
                    yield from _unknown(key, "link", link or robot.tool_frame, robot.model.link_names, robot)
            case _:
                return

    def _grip(self, step: Grip) -> Iterator[Wrong]:
        gripper = self._robot.gripper
        if gripper is None:
            yield "to", f"{self._robot.name} has no gripper: write a [gripper] into its robot.toml"
            return
        try:
            opening_of(gripper, step.to)
        except BadArgument as error:
            yield "to", in_words_of_a_file(str(error))

    def _motion(self, step: MotionStep) -> Iterator[Wrong]:
        if step.point and step.point not in self._points:
            yield "point", f'no point "{step.point}" of {self._robot.name}{suggestion(step.point, self._points)}'
        if step.state:
            yield from _unknown("state", "named state", step.state, self._robot.state_names, self._robot)
        if step.frame:
            yield from _unknown("frame", "link", step.frame, self._robot.model.link_names, self._robot)
        if step.joints:
            yield from self._joints(step.joints)

    def _joints(self, joints: Mapping[str, float]) -> Iterator[Wrong]:
        try:
            joint_state(self._robot, joints, "joints")
        except BadArgument as error:
            yield "joints", in_words_of_a_file(str(error))
            return
        for name, value in joints.items():
            joint = self._robot.joint(name)
            if not joint.is_within(joint.rounded(value)):
                limits = f"{joint.lower:.4g} to {joint.upper:.4g} {joint.unit}"
                yield "joints", f'joint "{name}" = {value:g} {joint.unit} is beyond its limits, {limits}'

    def _call(self, step: Call, callers: tuple[str, ...]) -> Iterator[Mistake]:
        """The mistakes of a called program; raises `BadArgument` where it cannot be called."""
        if step.program in callers:
            circle = " calls ".join(f'"{each}"' for each in (*callers[callers.index(step.program) :], step.program))
            raise BadArgument(f"this would never end: {circle}; take one of these calls out, or use repeat")
        if len(callers) > DEEPEST:
            raise BadArgument(f"calls are more than {DEEPEST} deep: {', '.join(callers)}")
        if step.program not in self._programs:
            raise BadArgument(f'no program "{program_name(step.program)}"{suggestion(step.program, self._programs)}')
        try:
            called = self._programs[step.program]
        except ProgramError as error:
            return iter(error.mistakes)
        except Error as error:
            raise BadArgument(str(error)) from error
        return self.of(called, (*callers, step.program))


def _unknown(key: str, kind: str, name: str, known: object, robot: ArmDescription) -> Iterator[Wrong]:
    assert isinstance(known, list | tuple)
    if name not in known:
        yield key, f'{robot.name} has no {kind} "{name}"{suggestion(name, known)}'
