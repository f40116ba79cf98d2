"""The arms that are measured."""

from __future__ import annotations

from services.arm.description import Arm, load_arm
from services.runtime.deployment import project_root


def rm1() -> Arm:
    return load_arm(project_root() / "urdf/rm1")


def parol6() -> Arm:
    return load_arm(project_root() / "urdf/parol6")
