"""One measured figure, in the form that `out/bench.json` has."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import msgspec


class Figure(msgspec.Struct, frozen=True, kw_only=True):
    """A figure; `median` and `p99` are None where it could not be measured, and `note` says why."""

    unit: str
    median: float | None = None
    p99: float | None = None
    goal: str = ""
    met: bool | None = None  # None where there is no goal, or no figure
    reference: dict[str, float] = {}
    note: str = ""


class Goal(msgspec.Struct, frozen=True, kw_only=True):
    """Upper bounds, in the figure's unit."""

    median: float | None = None
    p99: float | None = None

    def is_met(self, median: float, p99: float) -> bool:
        return median <= _or_infinity(self.median) and p99 <= _or_infinity(self.p99)

    def __str__(self) -> str:
        bounds = (("median", self.median), ("p99", self.p99))
        return ", ".join(f"{name} <= {bound:.4g}" for name, bound in bounds if bound is not None)


class NotMeasured(Exception):
    """The figure cannot be had here; the text says why."""


def _or_infinity(bound: float | None) -> float:
    return math.inf if bound is None else bound


def of_samples(
    samples: Sequence[float],
    unit: str,
    goal: Goal | None = None,
    reference: Mapping[str, float] | None = None,
    note: str = "",
) -> Figure:
    """Median and 99th percentile of `samples`, held against `goal`."""
    if not samples:
        raise NotMeasured("there was not a single sample")
    median, p99 = quantile(samples, 0.5), quantile(samples, 0.99)
    return Figure(
        unit=unit,
        median=rounded(median),
        p99=rounded(p99),
        goal="" if goal is None else str(goal),
        met=None if goal is None else goal.is_met(median, p99),
        reference={name: rounded(value) for name, value in (reference or {}).items()},
        note=note,
    )


def quantile(samples: Sequence[float], share: float) -> float:
    """The smallest sample that at least `share` of all do not exceed."""
    ordered = sorted(samples)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def rounded(value: float) -> float:
    """Four significant digits: more would claim what was not measured."""
    return float(f"{value:.4g}")


def guarded(measure: Callable[[], Figure], unit: str) -> Figure:
    """The figure, or one without a value that says why there is none."""
    try:
        return measure()
    except NotMeasured as error:
        return Figure(unit=unit, note=f"not measured: {error}")
    except Exception as error:
        return Figure(unit=unit, met=False, note=f"failed: {type(error).__name__}: {error}")
