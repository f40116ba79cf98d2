"""The folder of programs: which one it is, and the programs in it by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from gemelo.api.arm import Arm
from gemelo.api.errors import BadArgument
from gemelo.libraries.arm.errors import nearest
from gemelo.programs.names import checked_folder, program_name
from gemelo.programs.program import Program
from gemelo.programs.reading import read_program
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because


def programs_folder(of: Arm | Deployment) -> Path:
    """`paths.programs` of the deployment file ($GEMELO_PATHS_PROGRAMS): `programs` in the project if not said."""
    deployment = of.deployment if isinstance(of, Arm) else of
    return checked_folder(deployment.paths.programs)


class Programs(Mapping[str, Program]):
    """The programs of a folder, by name; each is read when it is asked for, so a change on the disk counts at once.

    >>> from gemelo.programs import Go, Program, Programs
    >>> Program("tour", (Go(state="left"), Go(state="ready"))).save(folder).name
    'tour.toml'
    >>> programs = Programs(folder)
    >>> list(programs), programs["tour"].steps[0].state
    (['tour'], 'left')
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = checked_folder(folder)

    def __getitem__(self, name: str) -> Program:
        """Raises KeyError where there is no such file, `ProgramError` with its mistakes where it is wrong."""
        if not isinstance(name, str) or name not in self:
            raise KeyError(name)
        return read_program(self.file(name))

    def __contains__(self, name: object) -> bool:
        try:
            return isinstance(name, str) and self.file(name).is_file()
        except BadArgument:
            return False

    def __iter__(self) -> Iterator[str]:
        names = (path.name.removesuffix(".toml") for path in self.folder.glob("*.toml"))
        return iter(sorted(name for name in names if name in self))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def require(self, name: str) -> Program:
        """The program; raises `BadArgument` with the nearest name, `ProgramError` with the mistakes of its file."""
        if name not in self:
            raise self._absent(name)
        return self[name]

    def remove(self, name: str) -> None:
        """Deletes its file; raises `BadArgument`."""
        if name not in self:
            raise self._absent(name)
        self.file(name).unlink(missing_ok=True)

    def rename(self, old: str, new: str) -> None:
        """Gives its file another name; calls of it elsewhere are not changed. Raises `BadArgument`."""
        if new in self and new != old:
            raise BadArgument(because("program.exists", program=new))
        if old not in self:
            raise self._absent(old)
        self.file(old).rename(self.file(new))

    def _absent(self, name: str) -> BadArgument:
        known = nearest(name, self)
        return BadArgument(because("program.absent", known, program=program_name(name), folder=str(self.folder)))

    def file(self, name: str) -> Path:
        """Where the program of that name is, or would be; raises `BadArgument` for what is no name."""
        return self.folder / f"{program_name(name)}.toml"
