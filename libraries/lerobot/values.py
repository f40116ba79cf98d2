"""LeRobot's names and units: `<joint>.pos` in degrees or millimetres, `gripper.pos` from 0 closed to 100 open."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.reasons import because

GRIPPER = "gripper.pos"
WHOLE = 100.0  # of an open gripper


class WrongValue(ReasonedError, ValueError):
    """An action or an option that cannot be meant; the reason has its name, and what would do."""


class ArmValues:
    """Translates between LeRobot's dictionaries and SI values by joint."""

    def __init__(self, arm: ArmDescription, *, use_degrees: bool, gripper: bool) -> None:
        self.joints = arm.joints
        self.gripper: Gripper | None = arm.gripper if gripper else None
        per_unit = {"rad": math.radians(1.0), "m": 0.001}
        self._scale = {joint.name: per_unit[joint.unit] if use_degrees else 1.0 for joint in arm.joints}

    @property
    def features(self) -> dict[str, type]:
        """Names of LeRobot's, in the order of robot.toml, the gripper last."""
        names = [f"{joint.name}.pos" for joint in self.joints]
        return dict.fromkeys([*names, GRIPPER] if self.gripper is not None else names, float)

    def positions(self, joints: Mapping[str, float]) -> dict[str, float]:
        """`joints` [rad] or [m] by name, as features."""
        return {f"{name}.pos": value / self._scale[name] for name, value in joints.items()}

    def opening(self, position: float) -> dict[str, float]:
        """The `position` [m] between the jaws, as a feature."""
        assert self.gripper is not None  # asked for by who has one
        closed, opened = self.gripper.closed, self.gripper.open
        return {GRIPPER: WHOLE * (position - closed) / (opened - closed)}

    def targets(self, action: Mapping[str, Any]) -> dict[str, float]:
        """[rad] or [m] by joint within the limits, of numbers or tensors of one; raises `WrongValue`."""
        known = self.features
        if unknown := sorted(set(action) - set(known)):
            raise WrongValue(because("lerobot.action.unknown", name=unknown[0], names=tuple(known)))
        found = {}
        for joint in self.joints:
            name = f"{joint.name}.pos"
            if name in action:
                found[joint.name] = joint.clamp(number(name, action[name]) * self._scale[joint.name])
        return found

    def rows(self, values: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float32]]:
        """Rows (n, features) of joints [rad] or [m], the opening [m] last where there is one, in LeRobot's units."""
        scales, zeros = list(self._scale.values()), [0.0] * len(self.joints)
        if self.gripper is not None:
            scales.append((self.gripper.open - self.gripper.closed) / WHOLE)
            zeros.append(self.gripper.closed)
        return np.asarray((values - np.asarray(zeros)) / np.asarray(scales), np.float32)

    def gripper_target(self, action: Mapping[str, Any]) -> float | None:
        """[m] between the jaws; None where the action has no gripper."""
        if self.gripper is None or GRIPPER not in action:
            return None
        share = min(max(number(GRIPPER, action[GRIPPER]) / WHOLE, 0.0), 1.0)
        return self.gripper.closed + share * (self.gripper.open - self.gripper.closed)

    def lengths(self, option: str, limit: float | Mapping[str, float]) -> dict[str, float]:
        """An option in LeRobot's units, for all joints or by name, as [rad] or [m]; raises `WrongValue`."""
        names = [joint.name for joint in self.joints]
        by_name = limit if isinstance(limit, Mapping) else dict.fromkeys(names, limit)
        by_name = {name.removesuffix(".pos"): value for name, value in by_name.items()}
        if unknown := sorted(set(by_name) - set(names)):
            what = because("lerobot.option.joint", option=option, name=unknown[0], names=tuple(names))
            raise WrongValue(what)
        for name, value in by_name.items():
            if not value > 0.0:
                what = because("lerobot.option.above_zero", option=option, joint=name, value=float(value))
                raise WrongValue(what)
        return {name: value * self._scale[name] for name, value in by_name.items()}


def number(name: str, value: Any) -> float:
    """The value as a float, in the unit of the caller; raises `WrongValue` where it is not finite."""
    found = float(value)
    if not math.isfinite(found):
        raise WrongValue(because("lerobot.action.not_finite", name=name, value=str(found)))
    return found
