"""The median of several images, and why a thing that is seen cannot be picked as it is seen."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from gemelo.api.seeing import Seen, add_to_scene, body_of, combined, streams, why_unclear
from gemelo.api.units import Pose
from gemelo.schemas.camera import CameraCondition, CameraStatus
from gemelo.schemas.cell import ColourThing, TagThing
from gemelo.schemas.detections import Detection, DetectionKind, Detections, Unclear
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because

TURN = (0.0, 0.0, 0.0, 1.0)


def image(stamp: int, *items: Detection) -> Detections:
    return Detections(stamp=stamp, camera="overhead", items=items)


def cup(x: float, sigma: float = 1e-4, **fields: object) -> Detection:
    values: dict[str, object] = {
        "name": "cup", "kind": DetectionKind.TAG, "sigma": sigma, "is_located": True,
        "base_from_thing": Transform(translation=(x, 0.1, 0.04), rotation=TURN),
    }  # fmt: skip
    return Detection(**values | fields)  # type: ignore[arg-type]


def test_the_median_of_five_images_leaves_an_outlier_out() -> None:
    images = [image(k, cup(x)) for k, x in enumerate((0.2, 0.2001, 0.5, 0.1999, 0.2))]
    (seen,) = combined(images, ["cup", "bin"])
    assert seen.pose.position == (0.2, 0.1, 0.04)
    assert seen.stamp == 4
    assert seen.sigma > 0.1  # the outlier makes it unsure
    assert "+-" in seen.trouble


def test_what_only_two_of_five_images_show_is_not_seen() -> None:
    assert combined([image(1, cup(0.2)), image(2), image(3, cup(0.2)), image(4), image(5)], ["cup"]) == []


def test_what_most_images_show_and_none_can_measure_is_told_with_the_reason_and_what_few_show_is_not() -> None:
    why = because("detect.outline", colour="red", boxes=("20 x 20 x 40",))
    unclear = Unclear(names=("red", "other"), reason=str(why), why=why)
    hidden = Detections(camera="overhead", unclear=(unclear,))
    assert why_unclear([hidden, image(1), hidden, hidden, image(2)], "red") == why
    assert why_unclear([hidden, image(1), hidden, image(2), image(3)], "red") is None
    assert why_unclear([hidden] * 5, "cup") is None
    old = Detections(camera="overhead", unclear=(Unclear(names=("red",), reason="partly hidden?"),))
    assert str(why_unclear([old] * 5, "red")) == "partly hidden?"


def test_what_is_seen_twice_cannot_be_picked() -> None:
    (seen,) = combined([image(k, cup(0.2), cup(0.3)) for k in range(5)], ["cup"])
    assert "seen 2 times" in seen.trouble


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"is_located": False}, "where the camera overhead stands"),
        ({"flip_ratio": 0.8}, "tilted one way or the other"),
        ({"sigma": 0.003}, "known to +-3.0 mm only"),
    ],
)
def test_what_is_not_sure_enough_is_said(fields: dict[str, object], said: str) -> None:
    (seen,) = combined([image(k, cup(0.2, **fields)) for k in range(5)], ["cup"])  # type: ignore[arg-type]
    assert said in seen.trouble


def test_what_scatters_less_than_it_claims_keeps_its_claim() -> None:
    (seen,) = combined([image(k, cup(0.2 + 1e-6 * k)) for k in range(5)], ["cup"])
    assert seen.sigma == 1e-4
    assert seen.trouble == ""


@dataclass
class Boxes:
    """Takes what a scene would."""

    added: list[tuple[object, ...]] = field(default_factory=list)

    def add_box(self, name: str, size: object, at: object, orientation: object, padding: float) -> None:
        self.added.append((name, size, at, padding))


def test_a_tagged_thing_becomes_the_box_below_its_tag() -> None:
    boxes = Boxes()
    thing = TagThing(name="cup", id=1, size=0.028, box=(0.036, 0.036, 0.04))
    add_to_scene(boxes, thing, Seen("cup", Pose((0.2, 0.1, 0.04)), 1e-3, "tag", "overhead", 1, ""))  # type: ignore[arg-type]
    ((name, size, at, padding),) = boxes.added
    assert (name, size) == ("cup", (0.036, 0.036, 0.04))
    assert at == pytest.approx((0.2, 0.1, 0.02))
    assert padding == pytest.approx(3e-3)


def test_a_tag_without_a_body_is_a_sheet_and_a_block_is_itself() -> None:
    assert body_of(TagThing(name="flat", id=1, size=0.03))[0] == (0.03, 0.03, 0.002)
    block = ColourThing(name="red", colour="red", box=(0.03, 0.02, 0.01))  # type: ignore[arg-type]
    assert body_of(block) == ((0.03, 0.02, 0.01), ((0.0, 0.0, 0.0), TURN))


@pytest.mark.parametrize(("condition", "is_so"), [(CameraCondition.STREAMING, True), (CameraCondition.FROZEN, False)])
def test_a_detector_is_waited_for_longer_only_while_its_camera_streams(condition, is_so):
    assert not streams([])
    assert streams([CameraStatus(condition=condition)]) is is_so
