"""Everything that `gemelo` shows to a user, with its docstring."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from types import ModuleType

import gemelo

# Not of this package: told of elsewhere.
SCHEMAS = {"DeviceMode", "GoalStatusCode", "Node", "StopKind", "planners", "topics"}
TABLES = {"Target", "ToolGoal"}  # arguments: their fields are told of by comments, and used by every example


def own_names() -> list[str]:
    """The public names that are defined in this package."""
    return [name for name in gemelo.__all__ if name not in SCHEMAS]


def documented() -> Iterator[tuple[str, str]]:
    """(dotted name, docstring) of all public names, and of the public members of classes."""
    for name in own_names():
        value = getattr(gemelo, name)
        assert not isinstance(value, ModuleType)
        yield name, inspect.getdoc(value) or ""
        if inspect.isclass(value) and name not in TABLES:
            for member, part in vars(value).items():
                if not member.startswith("_") and (callable(part) or isinstance(part, property | classmethod)):
                    yield f"{name}.{member}", inspect.getdoc(part) or ""
