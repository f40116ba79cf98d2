"""Stand-in for draccus.ChoiceRegistry, and how LeRobot finds the class of a configuration (utils/import_utils.py)."""

from __future__ import annotations

import importlib
from typing import Any, ClassVar


class ChoiceRegistry:
    """Configurations by the word after `--robot.type=`."""

    choices: ClassVar[dict[str, type]]

    def __init_subclass__(cls) -> None:
        if ChoiceRegistry in cls.__bases__:
            cls.choices = {}

    @classmethod
    def register_subclass(cls, name: str):
        def register(kind: type) -> type:
            cls.choices[name] = kind
            return kind

        return register

    @classmethod
    def get_choice_name(cls, kind: type) -> str:
        return next(name for name, each in cls.choices.items() if each is kind)


def make_device_from_device_class(config: Any) -> Any:
    """The device of a plug-in: the class of the configuration's name without Config, in its package or beside it."""
    kind = type(config)
    assert kind.__name__.endswith("Config")
    package, _, module = kind.__module__.rpartition(".")
    name = kind.__name__.removesuffix("Config")
    for candidate in (package, f"{package}.{name.lower()}", f"{package}.{module.replace('config_', '')}"):
        try:
            found = getattr(importlib.import_module(candidate), name, None)
        except ImportError:
            continue
        if callable(found):
            return found(config)
    raise ImportError(f"no class {name}")
