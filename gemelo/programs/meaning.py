"""Checks of a program against this robot: unknown names, values beyond limits, calls in a circle."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from gemelo.api.errors import BadArgument, Error
from gemelo.api.gripping import opening_of
from gemelo.api.targets import joint_state
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.names import program_name, read_text
from gemelo.programs.points import Point
from gemelo.programs.program import Program
from gemelo.programs.reading import parse_program, value_mistakes
from gemelo.programs.steps import AnyStep, Attach, Call, Grip, MotionStep, Output, Pick, WaitFor
from gemelo.programs.values import DEEPEST, Wrong
from gemelo.schemas.reasons import because

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
    found = find_mistakes(program, robot, points, programs)
    mistakes += [mistake for mistake in found if mistake not in mistakes]
    return tuple(sorted(mistakes, key=lambda each: (each.file != str(path), each.file, each.line, each.step)))


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
            what = because("program.robot.other", robot=program.robot, present=self._robot.name)
            mistakes.append(program.mistake((), "robot", what))
        called: list[Mistake] = []
        for path, step in program.all_steps():
            mistakes += [program.mistake(path, *wrong) for wrong in self._wrong(step)]
            if isinstance(step, Call):
                try:
                    called += self._call(step, callers)
                except BadArgument as error:
                    mistakes.append(program.mistake(path, "program", error.reason))
        yield from sorted(mistakes, key=lambda each: (each.line, each.step))
        yield from called

    def _wrong(self, step: AnyStep) -> Iterator[Wrong]:
        robot = self._robot
        match step:
            case MotionStep():
                yield from self._motion(step)
            case Output():
                outputs = [each.name for each in robot.outputs]
                yield from _unknown("name", "program.output.unknown", step.name, outputs, robot)
            case Grip():
                yield from self._grip(step)
            case Pick():
                if robot.gripper is None:
                    yield "thing", because("program.gripper.none", robot=robot.name)
            case WaitFor():
                sensors = [each.name for each in robot.sensors]
                yield from _unknown("sensor", "program.sensor.unknown", step.sensor, sensors, robot)
            case Attach():
                for key, link in (("link", step.link), *(("touch", each) for each in step.touch)):
                    links = robot.model.link_names
                    yield from _unknown(key, "program.link.unknown", link or robot.tool_frame, links, robot)
            case _:
                return

    def _grip(self, step: Grip) -> Iterator[Wrong]:
        gripper = self._robot.gripper
        if gripper is None:
            yield "to", because("program.gripper.none", robot=self._robot.name)
            return
        try:
            opening_of(gripper, step.to)
        except BadArgument as error:
            yield "to", error.reason

    def _motion(self, step: MotionStep) -> Iterator[Wrong]:
        if step.point and step.point not in self._points:
            near = nearest(step.point, self._points)
            yield "point", because("point.unknown", near, point=step.point, robot=self._robot.name)
        if step.state:
            yield from _unknown("state", "program.state.unknown", step.state, self._robot.state_names, self._robot)
        if step.frame:
            yield from _unknown("frame", "program.link.unknown", step.frame, self._robot.model.link_names, self._robot)
        if step.joints:
            yield from self._joints(step.joints)

    def _joints(self, joints: Mapping[str, float]) -> Iterator[Wrong]:
        try:
            joint_state(self._robot, joints, "joints")
        except BadArgument as error:
            yield "joints", error.reason
            return
        for name, value in joints.items():
            joint = self._robot.joint(name)
            if not joint.is_within(joint.rounded(value)):
                yield "joints", because(
                    "program.joint.limits", joint=name, value=value,
                    lower=joint.lower, upper=joint.upper, unit=joint.unit,
                )  # fmt: skip

    def _call(self, step: Call, callers: tuple[str, ...]) -> Iterator[Mistake]:
        """The mistakes of a called program; raises `BadArgument` where it cannot be called."""
        if step.program in callers:
            circle = (*callers[callers.index(step.program) :], step.program)
            raise BadArgument(because("program.calls.endless", programs=circle))
        if len(callers) > DEEPEST:
            raise BadArgument(because("program.calls.nested", programs=callers, limit=DEEPEST))
        if step.program not in self._programs:
            near = nearest(step.program, self._programs)
            raise BadArgument(because("program.unknown", near, program=program_name(step.program)))
        try:
            called = self._programs[step.program]
        except ProgramError as error:
            return iter(error.mistakes)
        except Error as error:
            raise BadArgument(error.reason) from error
        return self.of(called, (*callers, step.program))


def _unknown(key: str, code: str, name: str, known: Collection[str], robot: ArmDescription) -> Iterator[Wrong]:
    if name not in known:
        yield key, because(code, nearest(name, known), robot=robot.name, name=name)
