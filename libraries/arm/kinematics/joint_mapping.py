"""The mapping between the arm's joints and pinocchio's configuration: order, continuous joints and mimics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import wrong_file
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import UrdfJoint
from gemelo.schemas.reasons import because

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class _Entry:
    """One joint of pinocchio: where it takes its value from."""

    source: int  # index into the arm's joints
    multiplier: float
    offset: float  # [rad] or [m]
    q: int  # index into pinocchio's configuration
    v: int  # index into pinocchio's velocity
    is_circle: bool  # stored as cosine and sine


class JointMapping:
    """Fills pinocchio's vectors from the arm's joints, and folds its Jacobian's columns back."""

    def __init__(self, arm: ArmDescription, model: pin.Model) -> None:
        self._entries = [_entry(arm, model, index) for index in range(1, model.njoints)]
        self._size = len(arm.joints)
        self._is_same = self._entries == [_Entry(i, 1.0, 0.0, i, i, False) for i in range(self._size)]
        self._neutral = pin.neutral(model)
        self._fold = np.zeros((model.nv, self._size))
        for entry in self._entries:
            self._fold[entry.v, entry.source] = entry.multiplier

    def to_pinocchio(self, positions: Sequence[float] | Vector) -> Vector:
        """`positions` (n,) [rad] or [m] in the arm's order, as pinocchio wants them."""
        values: Vector = np.asarray(positions, dtype=float)
        if values.shape != (self._size,):
            raise ValueError(f"{values.shape} positions for {self._size} joints")
        if self._is_same:
            return values
        q: Vector = self._neutral.copy()
        for entry in self._entries:
            value = entry.multiplier * values[entry.source] + entry.offset
            if entry.is_circle:
                q[entry.q : entry.q + 2] = math.cos(value), math.sin(value)
            else:
                q[entry.q] = value
        return q

    def fold(self, jacobian: Vector) -> Vector:
        """pinocchio's Jacobian (6, nv) with the arm's joints as columns (6, n): [m/s], [rad/s] per joint rate."""
        if self._is_same:
            return jacobian
        folded: Vector = jacobian @ self._fold
        return folded


def _entry(arm: ArmDescription, model: pin.Model, index: int) -> _Entry:
    name, joint = model.names[index], model.joints[index]
    source, multiplier, offset = _driver_of(arm, arm.model.joint(name))
    return _Entry(source, multiplier, offset, joint.idx_q, joint.idx_v, joint.nq == 2)


def _driver_of(arm: ArmDescription, joint: UrdfJoint) -> tuple[int, float, float]:
    """The arm's joint that moves this one, with multiplier and offset through chains of mimics."""
    multiplier, offset, seen = 1.0, 0.0, {joint.name}
    while joint.mimic is not None:
        offset += multiplier * joint.mimic.offset
        multiplier *= joint.mimic.multiplier
        if joint.mimic.joint in seen or joint.mimic.joint not in arm.model.joint_names:
            what = because("urdf.mimic.no_driver", joint=joint.name, leader=joint.mimic.joint)
            raise wrong_file(arm.urdf_path, what)
        joint = arm.model.joint(joint.mimic.joint)
        seen.add(joint.name)
    return arm.joint_names.index(arm.joint(joint.name).name), multiplier, offset
