"""Keeper of the process that expands a xacro file: starts it, reads files for it, and ends it when its time is over.

It is given the files of the folder that is imported and of the packages found for it, and no others.
"""

from __future__ import annotations

import base64
import glob
import json
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

import gemelo
from gemelo.libraries.arm.errors import DescriptionError, wrong_file
from gemelo.schemas.reasons import Reason, because

LONGEST = 30.0  # [s] of one expansion, chosen: the largest published robots take 2
LARGEST_FILE = 20_000_000  # [bytes] chosen
LARGEST_LINE = 100_000_000  # [bytes] chosen
MOST_MATCHES = 1000  # chosen
MOST_NOTES = 20  # chosen
PACKAGE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
MARKS_OF_A_PACKAGE = ("package.xml", "urdf", "xacro", "meshes")
SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/opt", "/etc/ld.so.cache", "/etc/ld.so.conf")
MODULE = "gemelo.libraries.robot_import.xacro_sandbox.process"
Find = Callable[[str], Path]


@dataclass(frozen=True)
class Expansion:
    """The text, the arguments that the file declares or uses, and its own messages."""

    text: str
    known: tuple[str, ...]
    notes: tuple[str, ...]


class Failed(Exception):
    """xacro could not expand the file: the name of its exception, and its text."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(f"{kind}: {text}")
        self.kind, self.text = kind, text


class Confined:
    """The files that a xacro file may have: of its folder `root`, and of packages that `find` gives."""

    def __init__(self, path: Path, root: Path, find: Find) -> None:
        self._path, self._find = path.resolve(), find
        self._roots = [root.resolve()]

    def read(self, path: str, by: str) -> bytes:
        """A file's content; raises `DescriptionError` where it is none of these, OSError where there is none."""
        resolved = Path(path).resolve()
        if resolved != self._path:
            self._require_inside(resolved, path, by)
        if not resolved.is_file():
            raise FileNotFoundError(2, "No such file or directory", path)
        if resolved.stat().st_size > LARGEST_FILE:
            size = resolved.stat().st_size
            raise wrong_file(by, because("import.xacro.large", file=path, bytes=size, limit=LARGEST_FILE))
        return resolved.read_bytes()

    def package(self, name: str) -> str:
        """The folder of a package, from now on one of those that are read; raises `DescriptionError`."""
        if not PACKAGE.fullmatch(name):
            raise wrong_file(self._path, because("import.xacro.package_name", package=name))
        folder = self._find(name)
        resolved = folder.resolve()
        if not self._is_inside(resolved):
            if not any((resolved / mark).exists() for mark in MARKS_OF_A_PACKAGE):
                folders = {"folder": str(folder), "to": str(self._roots[0])}
                what = because("import.xacro.no_package", package=name, marks=MARKS_OF_A_PACKAGE, **folders)
                raise wrong_file(self._path, what)
            self._roots.append(resolved)
        return str(folder)

    def matching(self, pattern: str, by: str) -> list[str]:
        """The paths that a pattern matches; raises `DescriptionError` for one that begins outside."""
        start = Path(re.split(r"[*?\[]", pattern, maxsplit=1)[0] + "x").parent
        self._require_inside(start.resolve(), pattern, by)
        return sorted(path for path, _ in zip(glob.iglob(pattern), range(MOST_MATCHES), strict=False))

    def _is_inside(self, resolved: Path) -> bool:
        """True if it is in one of the folders, and not hidden there."""
        inside = (resolved.relative_to(root) for root in self._roots if resolved.is_relative_to(root))
        return any(not any(part.startswith(".") for part in relative.parts) for relative in inside)

    def _require_inside(self, resolved: Path, path: str, by: str) -> None:
        if not self._is_inside(resolved):
            raise wrong_file(by, because("import.xacro.outside", file=path, folders=tuple(map(str, self._roots))))


def expand(path: Path, arguments: Mapping[str, str], files: Confined, seconds: float = LONGEST) -> Expansion:
    """The expansion in a process of its own, ended after `seconds` [s]; raises `DescriptionError` for what is refused,
    and `Failed`."""
    notes: list[str] = []
    with _process() as child:
        assert child.stdin is not None
        timer = threading.Timer(seconds, child.kill)
        timer.start()
        try:
            message: dict[str, Any] = {"path": str(path), "arguments": dict(arguments)}
            while True:
                child.stdin.write(json.dumps(message).encode() + b"\n")
                child.stdin.flush()
                asked = _next(child, notes)
                if "expanded" in asked:
                    return Expansion(asked["expanded"], tuple(asked["known"]), tuple(notes))
                if "refused" in asked:
                    raise DescriptionError(msgspec.convert(asked["refused"], Reason))
                if "failed" in asked:
                    raise Failed(asked["failed"], asked["text"])
                message = _answer(asked, files)
        except (BrokenPipeError, EOFError):
            child.wait()
            ended = because("import.xacro.ended", seconds=seconds, code=child.returncode)
            raise wrong_file(path, ended) from None
        finally:
            timer.cancel()


def _next(child: subprocess.Popen[bytes], notes: list[str]) -> dict[str, Any]:
    """The next request or the last word; messages of the file before it are added to `notes`."""
    assert child.stdout is not None
    while True:
        line = child.stdout.readline(LARGEST_LINE)
        if not line.endswith(b"\n"):
            raise EOFError
        asked: dict[str, Any] = json.loads(line)
        if "note" not in asked:
            return asked
        if len(notes) < MOST_NOTES:
            notes.append(str(asked["note"]))


def _answer(asked: Mapping[str, Any], files: Confined) -> dict[str, Any]:
    try:
        if "read" in asked:
            return {"value": base64.b64encode(files.read(asked["read"], asked["by"])).decode()}
        if "find" in asked:
            return {"value": files.package(asked["find"])}
        return {"value": files.matching(asked["glob"], asked["by"])}
    except DescriptionError as error:
        return {"refused": msgspec.to_builtins(error.reason)}
    except (OSError, ValueError) as error:
        return {"missing": getattr(error, "strerror", None) or str(error)}


@contextmanager
def _process() -> Iterator[subprocess.Popen[bytes]]:
    """The process, ended with the block."""
    child = subprocess.Popen(
        command(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env={"LC_ALL": "C.UTF-8"}
    )
    try:
        yield child
    finally:
        child.kill()
        child.wait()
        for stream in (child.stdin, child.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):  # what it was to be sent when it ended
                    stream.close()


def command() -> list[str]:
    """The process's command line: under bwrap where that is installed and may make namespaces."""
    bwrap = shutil.which("bwrap")
    around = [bwrap, *namespaces(*code())] if bwrap and _makes_namespaces(bwrap) else []
    return [*around, sys.executable, "-I", "-m", MODULE]


@cache
def _makes_namespaces(bwrap: str) -> bool:
    """True unless the system, as a container's often does, keeps it from them."""
    return subprocess.run([bwrap, "--unshare-all", "--ro-bind", "/", "/", "true"], capture_output=True).returncode == 0


def code() -> list[Path]:
    """The folder of the package, and those that it links to in a checkout."""
    package = Path(gemelo.__file__).parent
    return [package, *(each.resolve() for each in sorted(package.iterdir()) if each.is_symlink())]


def namespaces(*code: Path) -> list[str]:
    """Arguments of bwrap: no network, no other process, and of the disk the interpreter and `code` alone."""
    folders = dict.fromkeys([*SYSTEM, sys.base_prefix, sys.prefix, *map(str, code)])
    binds = [part for folder in folders for part in ("--ro-bind-try", folder, folder)]
    apart = ["--unshare-all", "--die-with-parent", "--new-session", "--clearenv"]
    return [*apart, "--tmpfs", "/tmp", *binds, "--dev", "/dev", "--"]
