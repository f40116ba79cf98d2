"""A cross-check of the URDF by yourdfpy: every mesh loads, and the tool pose is equal."""

from __future__ import annotations

import logging
import math
from pathlib import Path

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription

TOLERANCE = 1e-9  # [m]


def check_with_yourdfpy(arm: ArmDescription) -> list[Finding]:
    """Findings of yourdfpy on the arm's URDF; a warning where it is not installed."""
    file = arm.urdf_path.name
    try:
        import yourdfpy  # slow to load: trimesh comes with it
    except ModuleNotFoundError:
        remedy = "install the extra `view` to have the meshes opened"
        return [warning(file, "meshes", "not opened, because yourdfpy is not installed", remedy)]
    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)  # what it would warn of, the other checks say with lines
    try:
        other = yourdfpy.URDF.load(str(arm.urdf_path))
    except Exception as problem:  # of any mesh format's reader
        return [error(file, "meshes", f"yourdfpy cannot load it: {problem}", _suspects(arm.folder))]
    middle = [(joint.lower + joint.upper) / 2 if math.isfinite(joint.lower) else 0.0 for joint in arm.joints]
    other.update_cfg(dict(zip(arm.joint_names, middle, strict=True)))
    theirs = other.get_transform(arm.tool_frame, arm.base_frame)[:3, 3]
    poses = link_transforms(arm.model, dict(zip(arm.joint_names, middle, strict=True)))
    base, tool = poses[arm.base_frame][0], poses[arm.tool_frame][0]
    ours = [b - a for a, b in zip(base, tool, strict=True)]
    off = max(abs(a - b) for a, b in zip(ours, theirs, strict=True))
    if off > TOLERANCE:
        return [error(file, f'link "{arm.tool_frame}"', f"is {off:.3g} m from where yourdfpy puts it")]
    return []


def _suspects(folder: Path) -> str:
    names = sorted(path.name for path in folder.glob("meshes/*"))
    return f"export the mesh again; in meshes/: {', '.join(names)}" if names else "correct the URDF"
