"""Which link's origin is the tool."""

from __future__ import annotations

import tomllib

from services.visualizer.model import Model


def tool_link(model: Model, robot_toml: str) -> str:
    """`tool_frame` of robot.toml; the last link of the tree where the file names none that the URDF has."""
    named = str(tomllib.loads(robot_toml).get("tool_frame", ""))
    return named if named in model.paths else max(model.paths, key=lambda link: model.paths[link].count("/"))
