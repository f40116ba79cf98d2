"""Statistics of a dataset's features, by which LeRobot scales them: of values, and of images by channel from 0 to 1."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image

from gemelo.libraries.lerobot.demonstrations import Array

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
LOOKED_AT = 50  # images of an episode; chosen: LeRobot looks at 100 at least of long ones
Statistics = dict[str, Any]  # lists by name: min, max, mean, std, count and quantiles
STEP = 4  # [px] between those of an image that are looked at


def statistics(rows: np.ndarray[Any, Any], shape: tuple[int, ...] = ()) -> Statistics:
    """Of rows (n, features), each as a list in `shape`, (features,) if left out; any unit."""
    values = rows.astype(np.float64)
    found = {
        "min": values.min(axis=0),
        "max": values.max(axis=0),
        "mean": values.mean(axis=0),
        "std": values.std(axis=0),
        **{name: np.quantile(values, share, axis=0) for name, share in QUANTILES.items()},
    }
    lists = {name: np.reshape(each, shape or (values.shape[1],)).tolist() for name, each in found.items()}
    return lists | {"count": [len(values)]}


def image_statistics(pictures: Sequence[bytes]) -> Statistics:
    """Of some pixels of some of the pictures, by channel as (3, 1, 1), from 0 to 1; `count` is of images."""
    chosen = sorted({round(at) for at in np.linspace(0, len(pictures) - 1, LOOKED_AT)})
    pixels = [np.asarray(decoded(pictures[index]))[::STEP, ::STEP].reshape(-1, 3) for index in chosen]
    found = statistics(np.concatenate(pixels) / 255.0, (3, 1, 1))
    found["count"] = [len(chosen)]
    return found


def decoded(picture: bytes) -> Image.Image:
    """In RGB; raises OSError where it is no image."""
    return Image.open(io.BytesIO(picture)).convert("RGB")


def statistics_together(parts: Sequence[Statistics]) -> Statistics:
    """Of several episodes, weighted by their counts; quantiles are the means of theirs, as LeRobot takes them."""
    counts = np.asarray([part["count"][0] for part in parts], float)

    def mean(name: str) -> Array:
        values = np.asarray([part[name] for part in parts], float)
        return np.asarray(np.average(values, axis=0, weights=counts))

    means = np.asarray([part["mean"] for part in parts], float)
    deviations = np.asarray([part["std"] for part in parts], float)
    spread = deviations**2 + (means - mean("mean")) ** 2
    return {
        "min": np.min([part["min"] for part in parts], axis=0).tolist(),
        "max": np.max([part["max"] for part in parts], axis=0).tolist(),
        "mean": mean("mean").tolist(),
        "std": np.sqrt(np.average(spread, axis=0, weights=counts)).tolist(),
        "count": [int(counts.sum())],
        **{name: mean(name).tolist() for name in QUANTILES},
    }
