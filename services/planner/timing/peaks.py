"""The largest velocity, acceleration and jerk of the quintics through a trajectory's points, between them too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.timing.profile import JointLimits

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SHARES = np.linspace(0.0, 1.0, 5)[1:-1]  # of a segment, at which velocities are looked at


def peak_shares(stamps: Array, p: Array, v: Array, a: Array, limits: JointLimits) -> tuple[float, float, float]:
    """The largest shares of any joint's limits, at `stamps` (m,) [s] with positions, velocities, accelerations (m, n).

    Jerk and acceleration are taken where their derivatives are zero; to a velocity comes what it may gain between two
    looks. The coefficients are those of Biagiotti and Melchiorri 2008, section 2.1.
    """
    dt = np.diff(stamps)[:, None]
    v0, v1, a0, a1 = v[:-1] * dt, v[1:] * dt, a[:-1] * dt * dt, a[1:] * dt * dt
    rise, climb, bend = p[1:] - p[:-1] - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    third, fourth, fifth = (
        10.0 * rise - 4.0 * climb + 0.5 * bend,
        -15.0 * rise + 7.0 * climb - bend,
        6.0 * rise - 3.0 * climb + 0.5 * bend,
    )
    c0, c1, c2 = 6.0 * third, 24.0 * fourth, 60.0 * fifth  # of the jerk, by powers of the segment's share
    with np.errstate(divide="ignore", invalid="ignore"):
        summit = _inside(-c1 / (2.0 * c2))
        root = np.sqrt(c1 * c1 - 4.0 * c0 * c2)
        still = [_inside((side * root - c1) / (2.0 * c2)) for side in (1.0, -1.0)] + [_inside(-c0 / c1)]
    jerk = np.maximum(np.abs(c0), np.abs(c0 + c1 + c2))
    jerk = np.maximum(jerk, np.abs(c0 + summit * (c1 + summit * c2)))
    acceleration = np.maximum(np.abs(a0), np.abs(a1))
    for u in still:
        acceleration = np.maximum(acceleration, np.abs(a0 + u * (c0 + u * (c1 / 2.0 + u * c2 / 3.0))))
    velocity = np.maximum(np.abs(v0), np.abs(v1))
    for u in SHARES.tolist():
        velocity = np.maximum(velocity, np.abs(v0 + u * (a0 + u * (c0 / 2.0 + u * (c1 / 6.0 + u * c2 / 12.0)))))
    velocity = velocity + jerk * (SHARES[0] ** 2 / 8.0)
    return (
        float((velocity / dt / limits.velocity).max()),
        float((acceleration / dt**2 / limits.acceleration).max()),
        float((jerk / dt**3 / limits.jerk).max()),
    )


def _inside(shares: Array) -> Array:
    """The shares within the segment; 0 for the others, and for what is no number."""
    inside: Array = np.where((shares > 0.0) & (shares < 1.0), shares, 0.0)
    return inside
