"""`gemelo camera list | view`: what is plugged in, what the cell file asks for, and what a camera sees now."""

from __future__ import annotations

import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from gemelo.libraries.arm.cell.cell_file import Cell, deployed_cell
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.schemas.camera import CameraCondition, CameraImage, CameraInfo, CameraStatus
from gemelo.schemas.cell import CameraRecord
from gemelo.schemas.detections import Detections
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import camera_detections, camera_image, camera_info, camera_status
from gemelo.tools.cli.camera.cells import cell_of
from gemelo.tools.cli.common.errors import CommandError, ExitCode, require_folder, unknown, usage
from gemelo.tools.cli.common.language import columns, reason_or, sentence, word
from gemelo.tools.cli.common.output import print_coloured
from gemelo.tools.cli.common.session import CommandSession, connect, load_robot
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Robot

PATIENCE = 2.0  # [s] for the first messages
DEVICES, BY_ID, NAMES = Path("/dev"), Path("/dev/v4l/by-id"), Path("/sys/class/video4linux")
NO_CELL = because("camera.no_cell", file="deploy/local.toml")
OUTLINE = (120, 255, 120)  # blue, green, red


@dataclass(frozen=True)
class Plugged:
    """A camera of this machine: the path to write into cell.toml, and what it calls itself."""

    device: str
    name: str


@dataclass(frozen=True)
class CameraReport:
    """What a camera has said of itself."""

    image: CameraImage | None = None
    info: CameraInfo | None = None
    status: CameraStatus | None = None
    found: Detections | None = None


def list_options(parser: Parser) -> None:
    """Adds --json."""
    json_option(parser)


def view_options(parser: Parser) -> None:
    """Adds the camera's name, where to save its image, and --watch."""
    parser.add_argument("camera", metavar="CAMERA", nargs="?", default="", help="of the cell file; its first one")
    parser.add_argument("--save", metavar="FILE", default="", help="write the image there, with what was found in it")
    parser.add_argument("-w", "--watch", action="store_true", help="again and again, until Ctrl-C")


def choices(robot: Robot | None) -> Choices:
    """The cameras of the cell file."""
    if robot is None:
        return {}
    try:
        return {"": deployed_cell(robot.deployment).camera_names}
    except DescriptionError:
        return {}


def run_list(options: Options) -> ExitCode:
    """Prints both tables; without a stack it is not known whether images come."""
    robot = load_robot()
    cell, devices = cell_of(robot), plugged()
    seen = _seen_of(robot, cell) if cell.cameras else {}
    if options.json:
        print(msgspec.json.encode(_listed(cell, devices, seen)).decode())
        return ExitCode.OK
    print(listing(cell, devices, seen))
    return ExitCode.OK


def run_view(options: Options) -> ExitCode:
    """Shows the newest image on the terminal, or saves it; raises `CommandError` where there is none."""
    robot = load_robot()
    cell = cell_of(robot)
    if not cell.cameras:
        raise usage(NO_CELL if cell.path == Path() else because("camera.cell.no_camera", file=str(cell.path)))
    name = options.camera or cell.cameras[0].name
    if name not in cell.camera_names:
        raise unknown("camera", name, cell.camera_names)
    if options.save:
        require_folder(Path(options.save).parent, f"--save {options.save}")
    with connect(robot) as session:
        while True:
            _show(_seen(session, name, needs_image=True), name, options.save)
            if not options.watch:
                return ExitCode.OK


def plugged() -> list[Plugged]:
    """Every camera of this machine; by an id that stays where there is one."""
    stable = {os.path.realpath(each): str(each) for each in sorted(BY_ID.glob("*-index0"))}
    devices = sorted(DEVICES.glob("video*"), key=lambda path: (len(path.name), path.name))
    return [
        Plugged(stable.get(str(each), str(each)), _name_of(each))
        for each in devices
        if str(each) in stable or not stable
    ]


def listing(cell: Cell, devices: list[Plugged], seen: dict[str, CameraReport]) -> str:
    """What is plugged in, then what the cell file asks for."""
    here = table(columns("plugged in", "name"), [(each.device, each.name) for each in devices])
    parts = [here if devices else sentence(because("camera.none_plugged"))]
    if cell.path == Path():
        return "\n\n".join([*parts, sentence(NO_CELL)])
    headings = columns("camera", "source", "size [px]", "asked [Hz]", "gets [Hz]", "lens", "place", "condition")
    rows = [_row(camera, seen.get(camera.name, CameraReport())) for camera in cell.cameras]
    statuses = [each.status for each in seen.values() if each.status is not None]
    said = [reason_or(status.why, status.text) for status in statuses if status.text]
    return "\n\n".join([*parts, "\n".join([table(headings, rows), *said])])


def drawn(image: CameraImage, found: Detections | None) -> bytes:
    """The JPEG with the outlines and names of what was found in it."""
    if found is None or not found.items:
        return image.data
    import cv2  # slow to load: OpenCV
    import numpy as np

    picture: Any = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR)
    for each in found.items:
        corners = np.array(each.corners, np.int32)
        if corners.ndim == 2 and len(corners) > 1:
            cv2.polylines(picture, [corners], True, OUTLINE, 1, cv2.LINE_AA)
            at = (int(corners[0, 0]), int(corners[0, 1]) - 6)
            cv2.putText(picture, each.name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.45, OUTLINE, 1, cv2.LINE_AA)
    jpeg: bytes = cv2.imencode(".jpg", picture)[1].tobytes()
    return jpeg


def on_terminal(jpeg: bytes, columns: int, rows: int) -> str:
    """The picture in half blocks, which have two square points each, of at most so many `columns` and `rows`."""
    import cv2  # slow to load: OpenCV
    import numpy as np

    picture: Any = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    height, width = picture.shape[:2]
    scale = min(columns / width, 2 * rows / height)
    size = max(1, int(width * scale)), max(2, int(height * scale) // 2 * 2)
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)[..., ::-1].tolist()
    lines = []
    for upper, lower in zip(small[::2], small[1::2], strict=True):
        points = (
            f"\x1b[38;2;{a};{b};{c}m\x1b[48;2;{d};{e};{f}m▀" for (a, b, c), (d, e, f) in zip(upper, lower, strict=True)
        )
        lines.append("".join(points) + "\x1b[0m")
    return "\n".join(lines)


def _show(seen: CameraReport, name: str, save: str) -> None:
    image = seen.image
    if image is None:
        raise CommandError(_why_no_image(seen, name))
    picture = drawn(image, seen.found)
    if save:
        Path(save).write_bytes(picture)
    elif sys.stdout.isatty():
        columns, rows = shutil.get_terminal_size()
        print_coloured(on_terminal(picture, columns, rows - 3))
    found = [f"{each.name} ± {each.sigma * 1e3:.2f} mm" for each in seen.found.items] if seen.found else []
    rate = f", {seen.status.fps:.0f} Hz" if seen.status is not None else ""
    where = f" -> {save}" if save else ""
    print(f"{name}: {image.width} x {image.height}, {len(image.data) / 1e3:.0f} kB{rate}{where}")
    print(sentence(because("camera.found", names=", ".join(found)) if found else because("camera.found.nothing")))


def _why_no_image(seen: CameraReport, name: str) -> Reason:
    if seen.status is None:
        return because("camera.silent.log", camera=name)
    if seen.status.text:
        return seen.status.why or plain(seen.status.text)
    return because("camera.no_image.condition", camera=name, condition=seen.status.condition.value, time=PATIENCE)


def _seen_of(robot: Robot, cell: Cell) -> dict[str, CameraReport]:
    """Of every camera; empty where no router listens."""
    try:
        with connect(robot) as session:
            return {name: _seen(session, name) for name in cell.camera_names}
    except CommandError as error:
        if error.code is not ExitCode.NO_STACK:
            raise
        return {}


def _seen(session: CommandSession, name: str, needs_image: bool = False) -> CameraReport:
    """What comes within `PATIENCE`."""
    heard: dict[str, Any] = {}
    subscriptions: list[Any] = [
        session.node.subscribe(camera_status(name), lambda message: heard.update(status=message)),
        session.node.subscribe(camera_info(name), lambda message: heard.update(info=message)),
    ]
    if needs_image:
        subscriptions += [
            session.node.subscribe(camera_image(name), lambda message: heard.update(image=message)),
            session.node.subscribe(camera_detections(name), lambda message: heard.update(found=message)),
        ]
    wanted = {"status", "info", "image"} if needs_image else {"status", "info"}
    deadline = session.node.monotonic() + PATIENCE
    while not wanted <= heard.keys() and session.node.monotonic() < deadline:
        session.node.wait(0.02)
        status = heard.get("status")
        if status is not None and status.text and "info" in heard:
            break  # it says why nothing comes
    for each in subscriptions:
        each.close()
    return CameraReport(**heard)


def _row(camera: CameraRecord, seen: CameraReport) -> tuple[str, ...]:
    status, info = seen.status, seen.info
    is_streaming = status is not None and status.condition is CameraCondition.STREAMING
    return (
        camera.name,
        str(camera.source.__struct_config__.tag),
        f"{camera.size[0]} x {camera.size[1]}",
        f"{camera.fps:g}",
        f"{status.fps:.0f}" if status is not None and is_streaming else "-",
        "-" if info is None else word("camera", "calibrated" if info.is_calibrated else "assumed"),
        "-" if info is None else word("camera", "measured" if info.is_mounted else "assumed"),
        word("camera", status.condition if status is not None else "not heard"),
    )


def _listed(cell: Cell, devices: list[Plugged], seen: dict[str, CameraReport]) -> dict[str, object]:
    cameras = [
        {
            "name": camera.name,
            "source": camera.source,
            "size": camera.size,
            "fps": camera.fps,
            "status": seen.get(camera.name, CameraReport()).status,
            "info": seen.get(camera.name, CameraReport()).info,
        }
        for camera in cell.cameras
    ]
    return {"devices": devices, "cameras": cameras}


def _name_of(device: Path) -> str:
    try:
        return (NAMES / device.name / "name").read_text().strip()
    except OSError:
        return ""
