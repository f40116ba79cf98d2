"""The motions of the demonstration: the seed's sine on the streaming topic, then a tour of planned goals."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gemelo import Target
from gemelo.libraries.arm.frames.transforms import compose, inverse
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.reasons import Reason, because

SINE_RATE = 10.0  # [Hz] of the targets
SINE_TIME = 10.0  # [s]
SINE_PERIOD = 5.0  # [s]
SPEED_SHARE = 0.6  # of the velocity limit at the sine's fastest
RANGE_SHARE = 0.15  # of the joint's travel, at most, to either side

JOINT_TOUR = ((0.65, 0.35, 0.40), (0.35, 0.65, 0.60))  # shares of each joint's travel; repeated for more joints
POSE_TOUR = ((0.60, 0.60, 0.30), (0.40, 0.60, 0.50), (0.55, 0.35, 0.20))


@dataclass(frozen=True)
class TourMove:
    """One planned move of the tour."""

    name: Reason
    target: Target


@dataclass(frozen=True)
class Sine:
    """One joint's target over time, in [rad] or [m]; it begins and ends at its centre."""

    joint: str
    centre: float
    amplitude: float

    def at(self, time: float) -> float:
        """The target [rad] or [m] at `time` [s]."""
        return self.centre + self.amplitude * math.sin(math.tau * time / SINE_PERIOD)


def sine_of(joint: Joint, start: float) -> Sine:
    """A sine around `start` [rad] or [m], as large as the joint's limits and travel allow."""
    lower, upper = (joint.lower, joint.upper) if math.isfinite(joint.lower) else (start - math.pi, start + math.pi)
    fastest = SPEED_SHARE * joint.velocity * SINE_PERIOD / math.tau
    sharpest = SPEED_SHARE * joint.acceleration * (SINE_PERIOD / math.tau) ** 2
    amplitude = min(fastest, sharpest, RANGE_SHARE * (upper - lower))
    centre = min(max(start, lower + amplitude), upper - amplitude)
    return Sine(joint.name, centre, amplitude)


def tour(arm: ArmDescription) -> tuple[TourMove, ...]:
    """Every named state, home, some joint goals and tool positions; the last goal has step counts other than zero."""
    named = [
        TourMove(because("demo.tour.named", state=name), Target(named=name))
        for name in arm.named_states
        if name != "home"
    ]
    joints = [
        TourMove(because("demo.tour.joints", number=number), Target(joints=positions_at(arm, shares)))
        for number, shares in enumerate(JOINT_TOUR, 1)
    ]
    poses = [
        TourMove(because("demo.tour.tool", number=number), Target(position=tool_at(arm, positions_at(arm, shares))))
        for number, shares in enumerate(POSE_TOUR, 1)
    ]
    home = Target(joints=arm.reference_position)
    return (*named, TourMove(because("demo.tour.home"), home), *joints, *poses)


def positions_at(arm: ArmDescription, shares: tuple[float, ...]) -> tuple[float, ...]:
    """Joint values [rad] or [m] at these shares of their travel."""
    return tuple(
        joint.lower + shares[index % len(shares)] * (joint.upper - joint.lower)
        for index, joint in enumerate(arm.joints)
    )


def tool_at(arm: ArmDescription, positions: tuple[float, ...]) -> tuple[float, ...]:
    """Position (3,) [m] of the tool in the base frame at `positions` (n,) [rad] or [m]."""
    links = link_transforms(arm.model, dict(zip(arm.joint_names, positions, strict=True)))
    return tuple(compose(inverse(links[arm.base_frame]), links[arm.tool_frame])[0])
