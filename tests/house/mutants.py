"""Mutations of the product, drawn at random, and whether the tests notice each: `python -m tests.house.mutants --help`.

A mutation changes one operator or one number of one line. As many are drawn in each of the rooms that a motion goes
through, each candidate of a room being as likely as any other. It is written into a copy of this tree, where the tests
that `make test` has of its room run, those that name the changed module first, until one fails.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = {  # what is mutated: the tests that can see it, those that run first before the others
    "services/stepper_gateway": ("tests/stepper_gateway", "tests/simulation", "tests/replay"),
    "services/planner": ("tests/planner", "tests/simulation", "tests/replay"),
    "libraries/runtime": ("tests/runtime", "tests/simulation", "tests/stepper_gateway"),
    "firmware/core": ("tests/firmware", "tests/stepper_gateway", "tests/simulation"),
}
NOT_COPIED = (".git", ".venv", ".gemelo", "out", ".mypy_cache", ".ruff_cache", ".pytest_cache", "__pycache__")
COMPARISONS = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "=="}
ARITHMETIC = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
CPP_OPERATORS = {
    "<": "<=",
    "<=": "<",
    ">": ">=",
    ">=": ">",
    "==": "!=",
    "!=": "==",
    "&&": "||",
    "||": "&&",
    "+": "-",
    "-": "+",
}
CPP_TOKEN = re.compile(r"(?<= )(?:<=|>=|==|!=|&&|\|\||[<>+-])(?= )|\b\d+\b|\b(?:true|false)\b")
BUILDS = {  # what a changed C++ file is built by
    "firmware/core": ("sh", "firmware/bindings/build.sh"),
    "services/planner": ("sh", "services/planner/native/build.sh", sys.executable),
}
LIBRARIES = dict.fromkeys(ROOMS, "services/planner/native/*.so") | {"firmware/core": "firmware/build/*.so"}
NO_STATEMENT = re.compile(r"^\s*(?://|#|\*|template|static_assert|namespace|case)|//.*$|\"[^\"]*\"")
TIME = 900.0  # [s] for the tests of one mutation: a mutant that hangs is noticed


@dataclass(frozen=True)
class Mutation:
    """`length` characters at `offset` of a file become `after`."""

    room: str
    path: str
    line: int
    before: str
    after: str
    offset: int
    length: int


def candidates(room: str) -> Iterator[Mutation]:
    """Every mutation of a room's files."""
    for path in sorted((ROOT / room).rglob("*")):
        if path.suffix == ".py":
            found = _of_python(path.read_text())
        elif path.suffix in (".cpp", ".h") and "build" not in path.parts:
            found = _of_cpp(path.read_text())
        else:
            continue
        text = path.read_text()
        for offset, length, after in found:
            line = text.count("\n", 0, offset) + 1
            before = text[offset : offset + length]
            yield Mutation(room, str(path.relative_to(ROOT)), line, before, after, offset, length)


def draw(count: int, seed: int) -> list[Mutation]:
    """`count` mutations, as many of each room."""
    source = random.Random(seed)
    drawn = [source.sample(list(candidates(room)), -(-count // len(ROOMS))) for room in ROOMS]
    return [mutation for turn in zip(*drawn, strict=True) for mutation in turn][:count]


def _of_python(text: str) -> Iterator[tuple[int, int, str]]:
    """Offset, length and replacement of each mutation of a Python file."""
    starts = [0]
    for line in text.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    encoded = text.encode()

    def place(line: int, column: int) -> int:
        return len(encoded[: starts[line - 1] + column].decode())

    def between(left: ast.expr, right: ast.expr, operator: str, after: str) -> Iterator[tuple[int, int, str]]:
        begin, end = place(left.end_lineno or 0, left.end_col_offset or 0), place(right.lineno, right.col_offset)
        found = re.search(rf"(?<![<>=!*/]){re.escape(operator)}(?![=*/])", text[begin:end])
        if found is not None:
            yield begin + found.start(), len(operator), after

    symbols = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
    symbols |= {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in COMPARISONS:
                yield from between(left, right, symbols[type(operator)], COMPARISONS[type(operator)])
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in ARITHMETIC:
                yield from between(left, right, symbols[type(operator)], ARITHMETIC[type(operator)])
            case ast.BoolOp(op=ast.And(), values=[left, right]):
                yield from between(left, right, "and", "or")
            case ast.BoolOp(op=ast.Or(), values=[left, right]):
                yield from between(left, right, "or", "and")
            case ast.UnaryOp(op=ast.Not()):
                yield place(node.lineno, node.col_offset), 4, ""
            case ast.Constant(value=bool() as value):
                yield place(node.lineno, node.col_offset), len(str(value)), str(not value)
            case ast.Constant(value=int() | float() as value):
                begin, end = place(node.lineno, node.col_offset), place(node.end_lineno or 0, node.end_col_offset or 0)
                yield begin, end - begin, repr(_other(value))


def _of_cpp(text: str) -> Iterator[tuple[int, int, str]]:
    """The same of a C++ file."""
    offset = 0
    for line in text.splitlines(keepends=True):
        code = NO_STATEMENT.sub(lambda found: " " * len(found[0]), line)
        for token in CPP_TOKEN.finditer(code):
            word = token[0]
            if word in CPP_OPERATORS:
                after = CPP_OPERATORS[word]
            elif word in ("true", "false"):
                after = "false" if word == "true" else "true"
            else:
                after = str(_other(int(word)))
            yield offset + token.start(), len(word), after
        offset += len(line)


def _other(value: float) -> float:
    """A number that is not `value`: a large one is doubled, as one more may be the same to all that use it."""
    return value + 1 if abs(value) < 10 else 2 * value


def copied(folder: Path) -> Path:
    """A copy of this tree below `folder` with what is built and installed here."""
    tree = folder / "tree"
    shutil.copytree(ROOT, tree, symlinks=True, ignore=shutil.ignore_patterns(*NOT_COPIED))
    for git in ("init", "-q"), ("add", "."):  # some tests ask for what is versioned
        subprocess.run(["git", *git], cwd=tree, check=True, capture_output=True)
    for shared in (".venv", ".gemelo"):
        if (ROOT / shared).exists():
            (tree / shared).symlink_to(ROOT / shared)
    return tree


def mutated(text: str, mutation: Mutation) -> str:
    """The text of its file with the mutation; raises ValueError where the file is another."""
    end = mutation.offset + mutation.length
    if text[mutation.offset : end] != mutation.before:
        raise ValueError(f"{mutation.path}:{mutation.line}: {mutation.before!r} does not stand there")
    return text[: mutation.offset] + mutation.after + text[end:]


def outcome(tree: Path, mutation: Mutation, tests: Sequence[str], prefix: Sequence[str] = ()) -> str:
    """What notices the mutation in a copied tree: the test that fails, "does not build", "time"; or "survived".

    `prefix` stands before each command, as `nice` may.
    """
    path = tree / mutation.path
    original, built = path.read_text(), {each: each.read_bytes() for each in tree.glob(LIBRARIES[mutation.room])}
    try:
        path.write_text(mutated(original, mutation))
        is_native = path.suffix != ".py"
        if is_native and not _passes(tree, [*prefix, *BUILDS[mutation.room]]):
            return "does not build"
        return _first_failure(tree, tests, prefix) or "survived"
    finally:
        path.write_text(original)
        for library, content in built.items():
            library.write_bytes(content)  # it is newer than its sources


def near(mutation: Mutation) -> list[str]:
    """The files of the room's tests that name the changed module."""
    module = mutation.path.removesuffix(".py").replace("/", ".")
    files = sorted((ROOT / ROOMS[mutation.room][0]).rglob("test_*.py"))
    return [str(file.relative_to(ROOT)) for file in files if re.search(rf"{module}\b", file.read_text())]


def _passes(tree: Path, command: Sequence[str]) -> bool:
    return subprocess.run(command, cwd=tree, env=_environ(tree), capture_output=True, check=False).returncode == 0


def _environ(tree: Path) -> dict[str, str]:
    """In which a process imports the copied tree, not the installed one."""
    return os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}


def _first_failure(tree: Path, tests: Sequence[str], prefix: Sequence[str]) -> str:
    """The first test that fails; empty where all pass."""
    options = ["-x", "-q", "-rfE", "-n", "0", "-m", "not full", "-p", "no:cacheprovider"]
    command = [*prefix, sys.executable, "-m", "pytest", *options, *tests]
    with subprocess.Popen(
        command, cwd=tree, env=_environ(tree), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    ) as running:  # fmt: skip
        try:
            printed, _ = running.communicate(timeout=TIME)
        except subprocess.TimeoutExpired:
            os.killpg(running.pid, signal.SIGKILL)
            return "time"
    if running.returncode == 0:
        return ""
    failed = re.search(r"^(?:FAILED|ERROR|SUBFAIL\w*) (\S+)", printed, re.MULTILINE)
    return failed[1] if failed else f"pytest ends with {running.returncode}: {printed[-300:]}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="*", help="numbers of those that are tried; all of them otherwise")
    parser.add_argument("--list", action="store_true", help="print the mutations and try none")
    parser.add_argument("--near", action="store_true", help="try the tests alone that name the changed module")
    parser.add_argument("--prefix", default="", help='words before each command, as "nice -n 5"')
    parser.add_argument("tests", nargs="*", help="what runs in place of the tests of the room")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="gemelo-mutants-") as folder:
        tree = ROOT if options.list else copied(Path(folder))
        for number, mutation in enumerate(draw(options.count, options.seed)):
            if options.only is None or number in options.only:
                tests = options.tests or [*near(mutation), *(() if options.near else ROOMS[mutation.room])]
                found = "" if options.list or not tests else outcome(tree, mutation, tests, options.prefix.split())
                change = f"{mutation.before or repr('')} -> {mutation.after or repr('')}"
                print(f"{number:3} {mutation.path}:{mutation.line}  {change}  {found}", flush=True)


if __name__ == "__main__":
    main()
