"""A step of a program in one line, in the page's language and units: mm, mm/s, per cent."""

from __future__ import annotations

from gemelo.programs import (
    AnyStep,
    Arc,
    Attach,
    Call,
    Detach,
    Go,
    Grip,
    Line,
    Output,
    Pick,
    Play,
    Repeat,
    Speed,
    Wait,
    WaitFor,
    kind_of,
)
from gemelo.services.panel.words.words import Words


def step_text(step: AnyStep, words: Words) -> str:
    """What it does, as `ir a P1, redondeo 10 mm`."""
    return f"{words(f'step_{kind_of(step)}')} {_about(step, words)}"


def _about(step: AnyStep, words: Words) -> str:
    match step:
        case Go() | Line() | Arc():
            return ", ".join((_goal(step, words), *_how(step, words)))
        case Output():
            return f"{step.name} {words('is_on' if step.on else 'is_off')}"
        case Grip():
            known = {"open": words("is_open"), "close": words("is_closed")}
            return known.get(step.to, step.to) if isinstance(step.to, str) else f"{1e3 * step.to:g} mm"
        case Pick():
            return f"{step.thing} → {step.place}"
        case Play():
            return f"{step.demonstration}, {100.0 * step.share:g} %"
        case Wait():
            return f"{step.time:g} s"
        case WaitFor():
            return f"{step.sensor} > {step.above:g}" if step.above is not None else f"{step.sensor} < {step.below:g}"
        case Speed():
            return f"{100.0 * step.share:g} %"
        case Attach() | Detach():
            return step.object
        case Repeat():
            return words("times", count=step.count)
        case Call():
            return step.program


def _goal(step: Go | Line | Arc, words: Words) -> str:
    if step.point or step.state:
        return step.point or step.state
    if step.position is not None:
        return _millimetres(step.position)
    return words("further", by=_millimetres(step.offset)) if step.offset is not None else words("joint_values")


def _millimetres(values: tuple[float, float, float]) -> str:
    return " ".join(f"{1e3 * value:g}" for value in values) + " mm"


def _how(step: Go | Line | Arc, words: Words) -> list[str]:
    told = []
    if isinstance(step, Line | Arc) and step.tool_speed:
        told.append(f"{1e3 * step.tool_speed:g} mm/s")
    if step.blend:
        told.append(f"{words('blend')} {1e3 * step.blend:g} mm")
    return told
