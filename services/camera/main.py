"""`gemelo-camera`: the images of every camera of the cell file; without one it stands aside."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE
from gemelo.libraries.arm.cell.cell_file import Cell, load_cell, read_cell_texts
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.cell import CellTexts
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.topics import CELL

RATE = 10.0  # [Hz] of the watch over the cameras
ASIDE_RATE = 1.0  # [Hz]
CAMERA_FILE_PERIOD = 1.0  # [s] between two looks at camera.toml


def run(node: Node, deployment: Deployment) -> None:
    """Publish until the node is stopped; ready as soon as every camera is watched, whether it gives images or not."""
    arm = load_arm(project_root() / deployment.robot)
    cell = load_cell(Path(deployment.cell), arm) if deployment.cell else Cell(Path())
    shown = node.publisher(CELL)
    shown.put(read_cell_texts(cell.path) if deployment.cell else CellTexts())
    if not cell.cameras:
        why = f"{deployment.cell} has no [[camera]]" if deployment.cell else "the deployment names no cell file"
        node.log.info("%s: this process stands aside", why)
        node.spin(lambda now: node.set_ready(True), rate=ASIDE_RATE)
        return
    # A device that hangs gives up after this time instead of OpenCV's 10 s; read when cv2 is loaded.
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "2")
    from gemelo.services.camera.cameras import Cameras  # OpenCV: 60 MB that only a cell with cameras is worth

    cameras = Cameras(node, arm, cell)

    def tell(known: Cell) -> None:
        cameras.tell_about(known)
        shown.put(read_cell_texts(known.path))

    node.every(CAMERA_FILE_PERIOD, _watch(node, arm, cell, tell))
    node.at_end(cameras.close)
    node.spin(cameras.step, rate=RATE)


def _watch(node: Node, arm: ArmDescription, cell: Cell, tell: Callable[[Cell], None]) -> Callable[[], None]:
    """Tells the cell anew whenever the wizard has written camera.toml."""
    file, known = cell.path.with_name(CAMERA_FILE), -1

    def look() -> None:
        nonlocal known
        changed = file.stat().st_mtime_ns if file.exists() else 0
        if changed == known:
            return
        is_first, known = known < 0, changed
        try:
            tell(cell if is_first else load_cell(cell.path, arm))
        except DescriptionError as error:
            node.log.warning("%s; the cameras stay as they were known before", error)

    look()
    return look


def main() -> None:
    """Console script `gemelo-camera`."""
    service("camera", run)


if __name__ == "__main__":
    main()
