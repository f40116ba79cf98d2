"""The labels of the view: the names of its series and of the device's modes, in its language."""

from __future__ import annotations

from gemelo.schemas.reasons import because, say
from gemelo.services.visualizer.content import palette

OF_VIEW = {"OFFLINE": because("view.offline"), "WAITING": because("view.waiting.label")}  # modes that no device has
COMMANDED, EXECUTED = because("view.series.commanded"), because("view.series.executed")
ERROR, LOST = because("view.series.error"), because("view.series.lost")
BAND = (because("view.series.upper"), because("view.series.lower"))  # around a step error


def mode_labels(language: str) -> list[str]:
    """Of each mode of `palette.MODES`, in capitals."""
    reasons = (OF_VIEW.get(name) or because("status.mode", mode=name) for name in palette.MODES)
    return [say(reason, language).upper() for reason in reasons]


def band_labels(language: str) -> list[str]:
    """Of the two lines half a step from no error."""
    return [say(each, language) for each in BAND]
