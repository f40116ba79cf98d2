"""A program: named steps, read from a file and written into one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gemelo.api.errors import BadArgument
from gemelo.api.whole_files import write_whole
from gemelo.libraries.toml_lines import Where
from gemelo.programs.mistakes import Mistake
from gemelo.programs.names import program_name
from gemelo.programs.steps import AnyStep, Repeat, StepPath, path_text
from gemelo.programs.toml_text import program_text
from gemelo.schemas.reasons import Reason, because

VERSION = 1  # of the files of programs and points


@dataclass(frozen=True)
class Program:
    """A name, steps, and the robot that it is for if it is for one alone.

    >>> from gemelo.programs import Go, Program, Repeat
    >>> program = Program("tour", (Repeat(count=2, steps=(Go(state="left"), Go(state="ready"))),))
    >>> program.step((0, 1)).state
    'ready'
    """

    name: str
    steps: tuple[AnyStep, ...]
    robot: str = ""  # empty: any
    file: Path | None = field(default=None, compare=False)  # that it was read from or saved to
    lines: Mapping[Where, int] = field(default_factory=dict, compare=False, repr=False)  # of the file

    def __post_init__(self) -> None:
        program_name(self.name)

    def step(self, path: StepPath) -> AnyStep:
        """The step at `path`, which may lead through repeats, not through calls; raises `BadArgument`."""
        steps: tuple[AnyStep, ...] = self.steps
        for depth, index in enumerate(path):
            if not 0 <= index < len(steps):
                break
            found = steps[index]
            if depth == len(path) - 1:
                return found
            steps = found.steps if isinstance(found, Repeat) else ()
        if not path:
            raise BadArgument(because("program.step.no_number", program=self.name))
        raise BadArgument(because("program.step.absent", program=self.name, step=path_text(path)))

    def all_steps(self) -> Iterator[tuple[StepPath, AnyStep]]:
        """Every step with its path, those of repeats behind the repeat."""
        yield from _all((), self.steps)

    def to_toml(self) -> str:
        """The text of its file: a step on each line; comments of a file that a person wrote are not in it."""
        return program_text(VERSION, self.robot, self.steps)

    def save(self, folder: str | Path | None = None) -> Path:
        """Writes `<name>.toml` in `folder`, or where it was read from; the comments of a file there are lost."""
        if folder is None and self.file is None:
            raise BadArgument(because("program.file.none", program=self.name))
        path = Path(folder) / f"{self.name}.toml" if folder is not None else self.file
        assert path is not None
        if "\0" in str(path):
            raise BadArgument(because("program.folder.nul", folder=str(folder)))
        write_whole(path, self.to_toml().encode())
        return path

    def mistake(self, path: StepPath, key: str, what: Reason) -> Mistake:
        """A mistake at the key of a step, with its line where the program was read from a file."""
        place = step_place(path)
        line = self.lines.get((*place, key), self.lines.get(place, 0))
        return Mistake(str(self.file or self.name), line, path, what)


def step_place(path: StepPath) -> Where:
    """Where a step stands in the file: (2, 0) is steps[2].steps[0]."""
    return tuple(part for index in path for part in ("steps", index))


def _all(around: StepPath, steps: tuple[AnyStep, ...]) -> Iterator[tuple[StepPath, AnyStep]]:
    for index, step in enumerate(steps):
        yield (*around, index), step
        if isinstance(step, Repeat):
            yield from _all((*around, index), step.steps)
