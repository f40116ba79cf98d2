"""The compiled motion core: whether the arm is free, how far from touching, along a whole way, and a way to a goal.

Lengths in m, angles in rad, everything in the arm's base frame; joint values (n,) or (rows, n) in the arm's order.
Importing it raises `NativeMissing`, an ImportError, where the core has not been built.
"""

from services.planner.covers.shapes import Attachment, Mesh, Shape, ShapeKind
from services.planner.native.core import Contact, MotionCore
from services.planner.native.library import CancelFlag, NativeMissing
from services.planner.native.paths import FreePath, NoPath, Why

__all__ = [
    "Attachment",
    "CancelFlag",
    "Contact",
    "FreePath",
    "Mesh",
    "MotionCore",
    "NativeMissing",
    "NoPath",
    "Shape",
    "ShapeKind",
    "Why",
]
