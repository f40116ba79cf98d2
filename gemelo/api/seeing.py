"""Things that cameras see: several images of an arm that stands, and the median of what was found in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from gemelo.api.errors import BadArgument, Error, Refused, reason_of
from gemelo.api.scene import Scene
from gemelo.api.session import Session
from gemelo.api.units import Point, Pose
from gemelo.libraries.arm.cell.cell_file import Cell, cell_of, load_cell
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_message
from gemelo.libraries.runtime.endpoints import info_request
from gemelo.libraries.runtime.topics import Subscription
from gemelo.schemas.camera import CameraCondition, CameraStatus
from gemelo.schemas.cell import CellTexts, TagThing, Thing
from gemelo.schemas.detections import Detection, Detections
from gemelo.schemas.reasons import Reason, because, plain, remedy
from gemelo.schemas.system import Empty
from gemelo.schemas.topics import CAMERA, CELL, JOINT_STATES, camera_detections, camera_status

SAMPLE = "urdf/rm1/cell.toml"  # a cell file
TO_READ = 2.0  # [s] for the cell to come over the bus
IMAGES = 5  # of which the median is taken
ENOUGH = 3  # of them that must show a thing
ANSWER = 2.0  # [s] for the camera's process to tell its time
PATIENCE = 3.0  # [s] for the first image, beside the time that `IMAGES` of them take
BUSY = 6.0  # [s] beyond it where the camera streams: a detector on a busy host needs seconds for an image
TO_REST = 1.0  # [s] that an arm which is just arriving may take
AT_REST = 1e-3  # [rad/s] or [m/s]
STILL = 1e-3  # [rad] or [m] that it may be elsewhere after the images
OLDEST = 0.5  # [s] that an image may be old
UNCERTAIN = 0.002  # [m] standard deviation from which on a thing is not gripped
FLIPPED = 0.6  # ratio of the two poses' errors from which on they cannot be told apart
SHEET = 0.002  # [m] thickness of a tag without a body


class Seen(NamedTuple):
    """A thing that cameras see, in the arm's base frame; its frame is the middle of a box, or a tag's.

    >>> seen = gemelo.Seen("cup", gemelo.Pose((0.26, 0.16, 0.04)), 0.0001, "tag", "overhead", 0, "")
    >>> print(seen)
    cup (tag): 260.0 160.0 40.0 mm, +-0.10 mm by overhead
    """

    name: str  # in cell.toml
    pose: Pose
    sigma: float  # [m] standard deviation of its position
    kind: str  # "tag", "colour" or "box"
    camera: str
    stamp: int  # [ns UNIX] of the newest image that shows it
    trouble: str  # why it cannot be picked as it is seen; empty if it can
    why: Reason | None = None  # the same as data

    @property
    def summary(self) -> Reason:
        """One line for a person, as data.

        >>> gemelo.Seen("cup", gemelo.Pose((0.26, 0.16, 0.04)), 0.0001, "tag", "overhead", 0, "").summary.code
        'detect.seen'
        """
        at = tuple(1e3 * value for value in self.pose.position)  # [mm]
        seen = because(
            "detect.seen", thing=self.name, kind=self.kind, at=at, error=1e3 * self.sigma, camera=self.camera
        )
        return because("detect.seen.unfit", seen, self.why or plain(self.trouble)) if self.trouble else seen

    def __str__(self) -> str:
        """One line for a person."""
        return str(self.summary)


class Eyes:
    """The cameras of one connection."""

    def __init__(self, session: Session, scene: Scene) -> None:
        self._session, self._scene = session, scene

    def cell(self) -> Cell:
        """What stands around the arm, by the twin's cell.toml; raises `Refused` without one, `Error` if wrong."""
        path, arm = self._session.deployment.cell, self._session.description
        try:
            if path and Path(path).is_file():
                return load_cell(Path(path), arm)
            return cell_of(self._read_cell(), arm, is_here=False)
        except DescriptionError as error:
            raise Error(reason_of(error)) from error

    def _read_cell(self) -> CellTexts:
        """What the twin's process `camera` has published of its cell; raises `Refused` where it has none."""
        latest, robot = self._session.latest(CELL), self._session.description.name
        sample = remedy("start_with_cell", sample=SAMPLE)
        if CAMERA not in self._session.node.alive():
            why = because("detect.cell.no_camera", sample, robot=robot)
        elif not self._session.wait_for(lambda: latest.message is not None, TO_READ) or latest.message is None:
            why = because("detect.cell.silent", remedy("list_nodes"), robot=robot)
        elif not latest.message.path:
            why = because("detect.cell.none", sample, robot=robot)
        else:
            return latest.message
        raise Refused(why, check="cell")

    def detect(self, name: str, camera: str, in_scene: bool) -> tuple[Seen, ...]:
        """What is seen of `name`, or of all things and places; raises `Refused`, `BadArgument`, `Error` or `Lost`."""
        cell = self.cell()
        known = [each.name for each in (*cell.things, *cell.places)]
        if name and name not in known:
            raise BadArgument(_unknown_thing(cell.path, name, known))
        cameras = cell.camera_names if not camera else (_known_camera(cell, camera),)
        if not cameras:
            raise Refused(because("detect.no_camera", path=str(cell.path)), check="camera")
        stood = self._require_rest()
        found: dict[str, Seen] = {}
        unclear: Reason | None = None
        for each in cameras:
            images = self._images(cell, each)
            unclear = unclear or why_unclear(images, name)
            for seen in combined(images, known):
                other = found.get(seen.name)
                if other is None or (seen.trouble == "", -seen.sigma) > (other.trouble == "", -other.sigma):
                    found[seen.name] = seen
        moved = max(abs(a - b) for a, b in zip(stood, self._require_rest(), strict=True))
        if moved > STILL:
            raise _moving()
        if name and name not in found and unclear:
            raise Refused(because("detect.unclear", unclear, thing=name), check="detection", subject=name)
        if name and name not in found:
            raise Refused(_not_seen(name, cameras, sorted(found)), check="detection", subject=name)
        if in_scene:
            self._put_into_scene(cell, [seen for seen in found.values() if not name or seen.name == name])
        return tuple(seen for _, seen in sorted(found.items()) if not name or seen.name == name)

    def one(self, name: str, camera: str = "") -> Seen:
        """The thing of that name, as it can be picked; raises `Refused` with the reason where it cannot."""
        (seen,) = self.detect(name, camera, False)
        if seen.trouble:
            why = because("detect.unfit", seen.why or plain(seen.trouble), thing=name)
            raise Refused(why, check="detection", subject=name)
        return seen

    def _require_rest(self) -> tuple[float, ...]:
        """Where the joints stand [rad] or [m]; raises `Refused` where they do not."""

        def is_at_rest() -> bool:
            state = self._session.latest(JOINT_STATES).message
            return state is not None and all(abs(speed) < AT_REST for speed in state.velocity)

        self._session.newest(JOINT_STATES)
        if not self._session.wait_for(is_at_rest, TO_REST):
            raise _moving()
        return self._session.newest(JOINT_STATES).position

    def _images(self, cell: Cell, camera: str) -> list[Detections]:
        """What was found in the next images of a camera; raises `Refused` where none come, or they are old."""
        heard: list[Detections] = []
        status: list[CameraStatus] = []
        late: list[float] = []  # [s] how old images were that are left out
        node = self._session.node

        def on_found(message: Detections) -> None:
            with self._session.news:
                age = (begin - message.stamp) / 1e9 + node.monotonic() - answered
                if message.stamp >= begin and age <= OLDEST:
                    heard.append(message)
                else:
                    late.append(age)
                self._session.news.notify_all()

        # By the camera's own clock, which it looked at after this question: what it stamps from then on shows the rest.
        begin = self._session.call(info_request(CAMERA), Empty(), ANSWER).clock
        answered = node.monotonic()
        subscriptions: list[Subscription[Any]] = [
            node.subscribe(camera_detections(camera), on_found),
            node.subscribe(camera_status(camera), status.append),
        ]
        patience = PATIENCE + IMAGES / cell.camera(camera).fps
        try:
            if not self._session.wait_for(lambda: len(heard) >= IMAGES, patience) and not late and streams(status):
                patience += BUSY
                self._session.wait_for(lambda: len(heard) >= IMAGES, BUSY)
        finally:
            for each in subscriptions:
                each.close()
        if len(heard) < ENOUGH:
            raise Refused(_why_none(camera, status, late, patience), check="camera", subject=camera)
        doubt = heard[-1].doubt
        if doubt:
            why = because("detect.camera_doubt", heard[-1].doubt_why or plain(doubt), camera=camera)
            raise Refused(why, check="camera", subject=camera)
        return heard

    def _put_into_scene(self, cell: Cell, seen: Iterable[Seen]) -> None:
        for each in seen:
            thing = next((thing for thing in cell.things if thing.name == each.name), None)
            if thing is not None and not each.trouble:
                add_to_scene(self._scene, thing, each)


def add_to_scene(scene: Scene, thing: Thing, seen: Seen) -> None:
    """The thing as a box where it is seen, with three standard deviations around it."""
    size, center = body_of(thing)
    at, turn = compose((seen.pose.position, seen.pose.orientation), center)
    scene.add_box(thing.name, size, at=at, orientation=turn, padding=3.0 * seen.sigma)


def body_of(thing: Thing) -> tuple[Point, Rigid]:
    """The edges (3,) [m] of a thing's body, and where its middle is in the thing's frame."""
    if not isinstance(thing, TagThing):
        return thing.box, IDENTITY
    size = thing.box if thing.box is not None else (thing.size, thing.size, SHEET)
    return size, ((0.0, 0.0, -size[2] / 2.0), IDENTITY[1])


def combined(images: Sequence[Detections], known: Iterable[str]) -> list[Seen]:
    """The median of what several images of one camera show, of those names."""
    found = []
    for name in known:
        shown = [[item for item in image.items if item.name == name] for image in images]
        once = [(image.stamp, items[0]) for image, items in zip(images, shown, strict=True) if len(items) == 1]
        twice = sum(len(items) > 1 for items in shown)
        if twice >= ENOUGH:
            items = next(items for items in shown if len(items) > 1)
            why = because("detect.twice", count=len(items))
            found.append(_seen([(images[-1].stamp, items[0])], images[-1].camera, why))
        elif len(once) >= ENOUGH:
            found.append(_seen(once, images[-1].camera, None))
    return found


def why_unclear(images: Sequence[Detections], name: str) -> Reason | None:
    """Why something that most images of one camera show is not taken for the thing of that name; None if nothing may
    be it."""
    found = [next((each for each in image.unclear if name in each.names), None) for image in images]
    unclear = [each for each in found if each is not None]
    return unclear[-1].why or plain(unclear[-1].reason) if len(unclear) >= ENOUGH else None


def _seen(once: Sequence[tuple[int, Detection]], camera: str, trouble: Reason | None) -> Seen:
    """The median position, with the turn of the image that is nearest to it."""
    places = [item.base_from_thing.translation for _, item in once]
    middle: Point = (median(p[0] for p in places), median(p[1] for p in places), median(p[2] for p in places))
    item = min((item for _, item in once), key=lambda item: _apart(item.base_from_thing.translation, middle))
    spread = (sum(_apart(place, middle) ** 2 for place in places) / len(places)) ** 0.5
    sigma = max(median(item.sigma for _, item in once), spread)
    _, turn = from_message(item.base_from_thing)
    why = trouble or _trouble(item, camera, sigma)
    return Seen(
        name=item.name, pose=Pose(middle, turn), sigma=sigma, kind=str(item.kind), camera=camera,
        stamp=max(stamp for stamp, _ in once), trouble=str(why or ""), why=why,
    )  # fmt: skip


def _trouble(item: Detection, camera: str, sigma: float) -> Reason | None:
    if not item.is_located:
        return because("detect.camera_nowhere", camera=camera)
    if item.flip_ratio > FLIPPED:
        return because("detect.tilted", ratio=item.flip_ratio)
    if sigma > UNCERTAIN:
        return because("detect.uncertain", error=1e3 * sigma, limit=1e3 * UNCERTAIN)
    return None


def _unknown_thing(path: str | Path, name: str, known: Sequence[str]) -> Reason:
    if not known:
        return because("argument.thing.none", path=str(path), name=name)
    return because("argument.thing.unknown", path=str(path), name=name, names=tuple(known))


def _not_seen(name: str, cameras: Sequence[str], others: Sequence[str]) -> Reason:
    hint, by = remedy("view_camera"), ", ".join(cameras)
    if not others:
        return because("detect.not_seen", hint, thing=name, cameras=by)
    return because("detect.others_seen", hint, thing=name, cameras=by, others=", ".join(others))


def _moving() -> Refused:
    return Refused(because("detect.moving"), check="moving")


def _apart(first: Sequence[float], second: Sequence[float]) -> float:
    return float(sum((a - b) ** 2 for a, b in zip(first, second, strict=True)) ** 0.5)


def streams(status: Sequence[CameraStatus]) -> bool:
    """True if the camera's newest status says that images come."""
    return bool(status) and status[-1].condition is CameraCondition.STREAMING


def _why_none(camera: str, status: Sequence[CameraStatus], late: Sequence[float], patience: float) -> Reason:
    if status and status[-1].text:
        return status[-1].why or plain(status[-1].text)
    if late and min(late) > OLDEST:
        return because("detect.late", camera=camera, age=min(late), limit=OLDEST)
    if streams(status):
        return because("detect.detector_silent", time=patience)
    return because("detect.no_image", remedy("list_cameras"), camera=camera, time=patience)


def _known_camera(cell: Cell, name: str) -> str:
    try:
        return cell.camera(name).name
    except DescriptionError as error:
        raise BadArgument(reason_of(error)) from error
