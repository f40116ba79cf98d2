"""One sighting of a board from several images of it that were taken while all stood still; or why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gemelo.libraries.vision.boards import Sighting
from gemelo.libraries.vision.calibration.touches import board_in_camera
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import Array
from gemelo.libraries.vision.tag_pose import residuals
from gemelo.schemas.reasons import because

STEADY = 0.7  # [px] that a point may be elsewhere in another image
BLURRED = 0.2  # [px] standard deviation of a corner in an image that is out of focus or smeared
LEAST_HIDDEN, HIDDEN_AT = 0.1, 4.0  # [px] of corners that are surely not right; or so many standard deviations
FEWEST_TO_DROP = 3  # tags, of which one may be left out


def one_of(found: Sequence[Sighting | None], fewest: int) -> Sighting:
    """The mean of `found`; NotMeasured where one of them shows fewer than `fewest` points, is blurred, or differs."""
    seen = [each for each in found if each is not None]
    least = min((len(each.points) for each in found if each is not None), default=0) if len(seen) == len(found) else 0
    if least < fewest:
        uneven = {number for each in seen for number in each.uneven}
        why = because("measure.tags.few", seen=least // 4, least=fewest // 4)
        tags = ", ".join(map(str, sorted(uneven)))
        raise NotMeasured(because("measure.tags.hidden", why, tags=tags) if uneven else why)
    worst = max(each.sigma for each in seen)
    if worst > BLURRED:
        raise NotMeasured(because("measure.blurred", sigma=float(worst), most=BLURRED))
    places = [dict(zip(map(_key, each.points), each.pixels, strict=True)) for each in seen]
    common = [index for index, point in enumerate(seen[0].points) if all(_key(point) in place for place in places)]
    if len(common) < fewest:
        raise NotMeasured(because("measure.tags.differ"))
    points = seen[0].points[common]
    pixels = np.array([[place[_key(point)] for point in points] for place in places])
    moved = float(np.linalg.norm(pixels - pixels[0], axis=2).mean(axis=1).max())
    if moved > STEADY:
        raise NotMeasured(because("measure.moves", moved=moved))
    doubled = tuple(sorted({number for each in seen for number in each.doubled}))
    sigma = float(np.mean([each.sigma for each in seen]))  # most of it is the same in every image
    return Sighting(points, pixels.mean(axis=0), sigma, doubled)


def _key(point: Array) -> tuple[float, ...]:
    return tuple(np.round(point, 6).tolist())


def without_hidden(sighting: Sighting, model: CameraModel) -> Sighting:
    """The sighting without tags whose corners do not lie where the others put them: something hides one of their edges.

    NotMeasured where the corners of a single tag are those of no square.
    """
    kept = sighting
    while True:
        corners = _corner_errors(kept, model)
        worst = int(np.argmax(corners))
        limit = max(LEAST_HIDDEN, HIDDEN_AT * kept.sigma, HIDDEN_AT * float(np.median(corners)) * (len(corners) > 1))
        if corners[worst] <= limit:
            return kept
        if len(corners) <= FEWEST_TO_DROP:
            raise NotMeasured(because("measure.tag.no_square", off=float(corners[worst]), most=float(limit)))
        rest = np.delete(np.arange(len(kept.points)), slice(4 * worst, 4 * worst + 4))
        kept = replace(kept, points=kept.points[rest], pixels=kept.pixels[rest])


def _corner_errors(sighting: Sighting, model: CameraModel) -> Array:
    """(tags,) [px] of the corners of each tag, as if all of them were those of one flat board; unbiased."""
    ideal = model.ideal(sighting.pixels)
    off = residuals(sighting.points, ideal, model, board_in_camera(sighting, model)).reshape(-1, 8)
    freedom = off.size - 6
    return np.asarray(np.sqrt(np.sum(off**2, axis=1) * len(off) / freedom))
