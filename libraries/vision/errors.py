"""The error of what an image, a board or a measurement with them does not allow."""

from __future__ import annotations

from gemelo.schemas.errors import ReasonedError


class NotMeasured(ReasonedError, ValueError):
    """The images, or the points that were touched, do not tell what is to be measured; the reason says why."""
