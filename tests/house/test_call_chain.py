"""The call chain of ARCHITECTURE.md: every file and function is there, every `->` is a call, and it stays one move."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import pytest

from tests.additions import ROOT

MOST_FILES = 45
LINE = re.compile(r"^(?:(->|~>) )?([\w/.]+\.(?:py|cpp)) +(\w.*)$")
FILE = re.compile(r"[\w./]+/[\w.]+\.(?:py|cpp|h|go|sh)\b")


class Step(NamedTuple):
    """A function of a file, and how the one before it leads here: "->", "~>", or "" where a line begins anew."""

    how: str
    path: str
    name: str  # as `function` or `Class.method`


def steps(page: str) -> Iterator[Step]:
    """All steps of the page, in their order."""
    for block in re.findall(r"^```\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        for line in block.splitlines():
            if (found := LINE.match(line)) is None:
                continue
            how, path, rest = found.groups()
            words = rest.split()
            yield Step(how or "", path, words[0].removesuffix("()"))
            for arrow, name in zip(words[1::2], words[2::2], strict=True):
                yield Step(arrow, path, name.removesuffix("()"))


@cache
def bodies(path: str, name: str) -> tuple[str, ...]:
    """The text of each function, method or class of that name in the file."""
    text = (ROOT / path).read_text(encoding="utf-8")
    last = name.split(".")[-1]
    if path.endswith(".py"):
        return tuple(_in_python(text, name))
    pattern = rf"^[\w:<>&* ]*\b(?:\w+::)?{last}\([^;{{]*\)(?: const)? \{{$.*?^\}}$|^[^\n]*::{last}\([^\n]*\}}$"
    return tuple(found[0] for found in re.finditer(pattern, text, re.DOTALL | re.MULTILINE))


def _in_python(text: str, name: str) -> Iterator[str]:
    owner, _, last = name.rpartition(".")
    for node in ast.walk(ast.parse(text)):
        if owner and isinstance(node, ast.ClassDef) and node.name == owner:
            yield from (ast.unparse(each) for each in node.body if getattr(each, "name", "") == last)
        elif not owner and isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == last:
            yield ast.unparse(node)


def faults(page: str) -> Iterator[str]:
    """What does not hold, one sentence each."""
    before: Step | None = None
    for step in steps(page):
        if not (ROOT / step.path).is_file():
            yield f"there is no {step.path}"
        elif not bodies(step.path, step.name):
            yield f"{step.path} has no {step.name}()"
        elif step.how == "->":
            assert before is not None
            last = step.name.split(".")[-1]
            if not any(re.search(rf"\b{last}\b", body.partition("\n")[2]) for body in bodies(before.path, before.name)):
                yield f"{before.path}: {before.name}() does not call {last}() of {step.path}"
        before = step


@pytest.fixture(scope="module")
def page() -> str:
    return (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")


def test_every_step_of_the_chain_is_in_the_code(page: str) -> None:
    assert len(list(steps(page))) > 60
    assert list(faults(page)) == []


def test_the_page_names_few_files(page: str) -> None:
    files = set(FILE.findall(page)) - {each for each in FILE.findall(page) if each.startswith("tests/")}
    assert len(files) <= MOST_FILES, len(files)


@pytest.mark.parametrize(
    ("chain", "fault"),
    [
        ("tools/cli/gone.py    run()", "there is no tools/cli/gone.py"),
        ("tools/cli/main.py    run() -> jump()", "tools/cli/main.py has no jump()"),
        (
            "tools/cli/main.py    parse() -> main()",
            "tools/cli/main.py: parse() does not call main() of tools/cli/main.py",
        ),
        ("firmware/core/path.cpp    load() -> advance()",
         "firmware/core/path.cpp: load() does not call advance() of firmware/core/path.cpp"),
    ],
)  # fmt: skip
def test_what_is_not_so_is_found(chain: str, fault: str) -> None:
    assert list(faults(f"```\n{chain}\n```\n")) == [fault]


def test_a_call_from_file_to_file_is_known() -> None:
    chain = "tools/cli/main.py  main() -> run() -> _run() -> parse()\n-> tools/cli/parser.py  build()\n"
    assert [step.name for step in steps(f"```\n{chain}```\n")] == ["main", "run", "_run", "parse", "build"]
    assert list(faults(f"```\n{chain}```\n")) == []
