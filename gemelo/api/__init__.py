"""The Python interface of gemelo, whose public names `gemelo` itself has. A part of it, such as `api.motion`, is loaded
when it is first used: a script that only reads the arm's state loads no planning, no seeing and no picking."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gemelo.api import control as control
    from gemelo.api import device as device
    from gemelo.api import frames as frames
    from gemelo.api import gripping as gripping
    from gemelo.api import homing as homing
    from gemelo.api import jog as jog
    from gemelo.api import ledger as ledger
    from gemelo.api import motion as motion
    from gemelo.api import picking as picking
    from gemelo.api import planning as planning
    from gemelo.api import scene as scene
    from gemelo.api import seeing as seeing
    from gemelo.api import streaming as streaming
    from gemelo.api import targets as targets
    from gemelo.api import verification as verification
else:

    def __getattr__(name: str) -> ModuleType:
        """A part, loaded now (PEP 562)."""
        try:
            return import_module(f"{__name__}.{name}")
        except ModuleNotFoundError as error:
            if error.name != f"{__name__}.{name}":
                raise
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from error
