"""`gemelo-detector`: what is in the images of every camera of the cell file; without one it stands aside."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from gemelo.libraries.arm.cell.cell_file import Cell, load_cell
from gemelo.libraries.arm.frames.transforms import compose, inverse, to_message
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.node_clock import NodeClock
from gemelo.libraries.runtime.process.priority import lower_priority
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.cell import OnnxThing
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import CAMERA, GATEWAY, JOINT_STATES, camera_detections, camera_image, camera_info

if TYPE_CHECKING:
    from gemelo.libraries.vision.rigid import Array
    from gemelo.services.detector.core import Detector
    from gemelo.services.detector.user_models import UserModel

RATE = 1.0  # [Hz] of its own step, which does nothing: images wake it
SLACK = 0.02  # [s] that an image may come too early
SAME_TIME = 40_000_000  # [ns] between an image and the joint state that says where its camera was


class DetectorParameters(msgspec.Struct, frozen=True, kw_only=True):
    """How much of the machine it takes."""

    rate: Annotated[float, Meta(description="images of each camera that are looked at, at most [Hz]", gt=0, le=60)] = (
        4.0
    )


def run(node: Node, deployment: Deployment) -> None:
    """Look at every image until the node is stopped."""
    arm = load_arm(project_root() / deployment.robot)
    cell = load_cell(Path(deployment.cell), arm) if deployment.cell else Cell(Path())
    if not cell.cameras:
        node.log.info("there is no camera in the cell: this process stands aside")
    if cell.cameras:
        import cv2  # slow to load: OpenCV, which only a cell with cameras is worth

        from gemelo.services.detector.core import Detector  # OpenCV: 60 MB that only a cell with cameras is worth

        cv2.setNumThreads(1)
        models = read_models(cell, node.log.warning)
        places, parameters = Places(arm), node.parameters(DetectorParameters)
        clocks = Clocks(NodeClock(node, GATEWAY), NodeClock(node, CAMERA))

        def on_joint_state(state: JointState) -> None:
            stamp = clocks.gateway.to_own(state.stamp)
            if stamp is not None:
                places.on_joint_state(replace(state, stamp=stamp))

        node.subscribe(JOINT_STATES, on_joint_state)
        for camera in cell.cameras:
            CameraWatch(node, camera.name, Detector(cell, models), places, clocks.camera, lambda: parameters.value.rate)
    node.spin(lambda now: node.set_ready(True), rate=RATE)


def read_models(cell: Cell, warn: Callable[[str], object]) -> dict[Path, UserModel]:
    """The models of the cell's things, each once; what cannot be read is said to `warn`, and not looked for."""
    from gemelo.services.detector.user_models import BadModel, UserModel  # slow to load: OpenCV

    found: dict[Path, UserModel] = {}
    for thing in cell.things:
        if isinstance(thing, OnnxThing):
            path = cell.path_of(thing.model)
            try:
                if path not in found:
                    found[path] = UserModel(path, thing.input)
                found[path].number_of(thing.label)
            except BadModel as error:
                warn(str(because("model.thing", error.reason, thing=thing.name)))
    return found


class Clocks(NamedTuple):
    """Of the nodes whose stamps meet here; each may run on another host."""

    gateway: NodeClock
    camera: NodeClock


class Places:
    """Where the frames that carry cameras were at a moment; all stamps are by this node's clock."""

    def __init__(self, arm: ArmDescription) -> None:
        self._arm = arm
        self._states: deque[JointState] = deque(maxlen=64)  # 1.3 s of them

    def on_joint_state(self, state: JointState) -> None:
        self._states.append(state)

    def base_from_camera(self, info: CameraInfo, stamp: int | None) -> Array | None:
        """(4, 4) at `stamp` [ns UNIX]; None where the camera was never mounted, or the arm's state is not known then.

        `stamp` is None where the camera's clock is not known: then only for a camera that the arm does not carry.
        """
        from gemelo.libraries.vision.rigid import from_transform  # slow to load: OpenCV

        if not info.is_mounted:
            return None
        local = from_transform(info.parent_from_camera)
        if info.parent == self._arm.base_frame:
            return local
        if stamp is None:
            return None
        state = min(self._states, key=lambda each: abs(each.stamp - stamp), default=None)
        if state is None or abs(state.stamp - stamp) > SAME_TIME or len(state.position) != len(state.name):
            return None
        links = link_transforms(self._arm.model, dict(zip(state.name, state.position, strict=True)))
        if info.parent not in links:
            return None
        carrier = compose(inverse(links[self._arm.base_frame]), links[info.parent])
        return from_transform(to_message(carrier)) @ local


class CameraWatch:
    """One camera between the bus and the detector."""

    def __init__(
        self, node: Node, name: str, detector: Detector, places: Places, clock: NodeClock, rate: Callable[[], float]
    ) -> None:
        """`clock` stamps the images; `rate()` [Hz]: more images than that are left out."""
        self._node, self._name, self._detector, self._places, self._clock = node, name, detector, places, clock
        self._rate, self._due = rate, 0.0  # [s] monotonic
        self._info: CameraInfo | None = None
        self._found = node.publisher(camera_detections(name))
        self._said = ""
        node.subscribe(camera_info(name), self._on_info)
        node.subscribe(camera_image(name), self._on_image)

    def _on_info(self, info: CameraInfo) -> None:
        self._info = info

    def _on_image(self, image: CameraImage) -> None:
        import cv2  # slow to load: OpenCV, which only a cell with cameras is worth

        from gemelo.services.detector.images import NoPicture, decoded

        now = self._node.monotonic()
        if self._info is None or now < self._due - SLACK:
            return
        self._due = max(self._due, now - SLACK) + 1.0 / self._rate()
        try:
            where = self._places.base_from_camera(self._info, self._clock.to_own(image.stamp))
            found = self._detector.look(decoded(image), self._info, where, image.stamp)
        except (NoPicture, ValueError, cv2.error) as error:
            self._say(str(error).strip().replace("\n", " "))
            return
        self._say(found.doubt)
        self._found.put(found)

    def _say(self, text: str) -> None:
        """What is wrong, once."""
        if text and text != self._said:
            self._node.log.warning('camera "%s": %s', self._name, text)
        self._said = text


def main() -> None:
    """Console script `gemelo-detector`."""
    lower_priority()
    service("detector", run)


if __name__ == "__main__":
    main()
