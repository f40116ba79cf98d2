"""`make docs`: writes docs/api.md from the docstrings of `gemelo`, which run as tests (tests/gemelo)."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_type_hints

import gemelo

PAGE = Path(__file__).with_name("api.md")
SECTIONS = (  # title, names
    ("Connecting", ("connect", "robots", "load_robot", "Robot")),
    ("The arm", ("Arm",)),
    ("Where to and how", ("Target", "ToolGoal")),
    ("Plans and motions", ("Plan", "Motion", "Configurations", "HomingProgress", "HomingReport", "Gripped")),
    ("The step ledger", ("Ledger", "JointLedger", "Verification")),
    ("The scene", ("Scene", "load_mesh")),
    ("The device", ("Device",)),
    ("Who may move the arm", ("Control", "Hold")),
    ("A twin for your tests", ("simulate", "SimulatedArm", "SimulatedWorld", "SimulatedArms", "Simulation")),
    ("Errors", ("Error", "BadArgument", "Refused", "Aborted", "Canceled", "Lost", "Interrupted")),
    ("Units and poses", ("deg", "mm", "Pose")),
)
ELSEWHERE = """## Nodes

`from gemelo import Node, topics` is how one writes a node; [examples/](../examples) has five. `topics` is the table of
[schemas/topics.py](../schemas/topics.py), `Node` is that of [libraries/runtime/node.py](../libraries/runtime/node.py).
`DeviceMode`, `GoalStatusCode` and `StopKind` are enumerations of [schemas/](../schemas).
"""
TABLES = ("Target", "ToolGoal")


def page() -> str:
    """The whole page."""
    parts = [
        "# `import gemelo`",
        "Made by `make docs` from the docstrings; every example runs as a test.",
        _doc(gemelo),
    ]
    for title, names in SECTIONS:
        parts.append(f"## {title}")
        for name in names:
            parts += _entry(name)
    return "\n\n".join([*parts, ELSEWHERE])


def _entry(name: str) -> Iterator[str]:
    value = getattr(gemelo, name)
    if name in TABLES:
        yield f"### {name}"
        yield _doc(value)
        yield _table(value)
    elif inspect.isclass(value):
        bases = [base.__name__ for base in value.__bases__ if base is not object and base is not tuple]
        yield f"### class {name}({', '.join(bases)})" if bases else f"### class {name}"
        yield _doc(value)
        yield from _fields(value)
        yield from _members(name, value)
    else:
        yield f"### `{name}{_signature(value)}`"
        yield _doc(value)


def _members(owner: str, kind: type) -> Iterator[str]:
    for name, part in vars(kind).items():
        if name.startswith("_"):
            continue
        if isinstance(part, property):
            assert part.fget is not None
            yield f"#### `{_variable(owner)}.{name} -> {_plain(part.fget.__annotations__['return'])}`"
        elif isinstance(part, classmethod):
            yield f"#### `{owner}.{name}{_signature(part.__func__)}`"
        elif inspect.isfunction(part):
            yield f"#### `{_variable(owner)}.{name}{_signature(part)}`"
        else:
            continue
        yield _doc(part)


def _variable(owner: str) -> str:
    """What a value of the class is called in the examples."""
    return {"Scene": "arm.scene", "Device": "arm.device", "Control": "arm.control"}.get(owner, owner.lower())


def _fields(kind: type) -> Iterator[str]:
    """The attributes that `__init__` or the class body declares with a comment."""
    lines = inspect.getsource(kind).splitlines()
    found = [re.fullmatch(r" +(?:self\.)?([a-z]\w*)(?:: .*?| = .*?)  # (.+)", line) for line in lines]
    rows = [f"- `{each[1]}`: {each[2]}" for each in found if each]
    if rows:
        yield "\n".join(rows)


def _table(kind: type) -> str:
    """A row for every argument, with its type and its comment."""
    rows = ["| argument | type | |", "|---|---|---|"]
    comments = dict(re.findall(r"^    (\w+): .*?  # (.+)$", inspect.getsource(kind), flags=re.MULTILINE))
    own = [name for name in get_type_hints(kind) if name in comments]
    for name in own:
        said = _plain(kind.__annotations__[name]).replace("|", "\\|")
        rows.append(f"| `{name}` | {said} | {comments[name]} |")
    return "\n".join(rows)


def _signature(function: Callable[..., object]) -> str:
    """As it is written, without `self`."""
    signature = inspect.signature(function)
    parameters = [each for name, each in signature.parameters.items() if name not in ("self", "cls")]
    return _plain(str(signature.replace(parameters=parameters)).removesuffix(" -> 'None'"))


def _plain(text: object) -> str:
    """Annotations without their quotes."""
    said = str(getattr(text, "__forward_arg__", text))
    return re.sub(r"(: |-> )'([^']+)'", r"\1\2", said)


def _doc(value: object) -> str:
    """The docstring with its examples as code."""
    blocks = (inspect.getdoc(value) or "").replace("\n\n    ", "\n    \n    ").split("\n\n")
    return "\n\n".join(_block(block) for block in blocks)


def _block(block: str) -> str:
    if block.startswith(">>>"):
        return f"```python\n{block}\n```"
    text, _, code = block.partition("\n    \n")
    return f"{text}\n\n```python\n{textwrap.dedent(code)}\n```" if code else text


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
