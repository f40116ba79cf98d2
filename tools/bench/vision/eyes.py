"""Figures of the eyes at work: what camera and detector cost at `RATE`, how soon a detection follows its image, and the
time of one image of the virtual camera and of its transfer over the bus.

The camera hands on stored JPEGs of the sample cell, as it does those of a webcam; the virtual one, which also has to
draw them, is a reference.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import psutil
from msgspec.structs import replace

from gemelo.libraries.arm.cell.camera_model import exact_info
from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.endpoints import parameter_request
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraImage
from gemelo.schemas.cell import VirtualSource
from gemelo.schemas.joints import JointState
from gemelo.schemas.system import SetParameter
from gemelo.schemas.topics import camera_detections, camera_image
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera
from gemelo.services.camera.virtual.world import CameraWorld
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.bench.stack import Stacks, cpu_seconds, families
from gemelo.tools.stack.stack import Stack

SET_RATE = parameter_request("detector")
PROCESSES = ("router", "camera", "detector")
RATE, USUAL = 15.0, 4.0  # [Hz] of the camera, and of the images that the detector looks at unless it is told
IMAGES = 30  # that are stored
SETTLE, WINDOW, WINDOWS = 3.0, 4.0, 5  # [s], [s]
MOST, LATEST = 25.0, 20.0  # [% of a core] both together, [ms]
SOURCE = 'kind = "folder"\npath = "images"\n'


@dataclass(frozen=True)
class CameraCost:
    """What was measured with one kind of camera."""

    camera: list[float]  # [% of a core] of each window
    detector: list[float]  # the same, every image looked at
    usual: float  # [% of a core] of the detector at its usual rate
    delays: list[float]  # [ms] from the image's stamp to the detection's arrival
    rate: float  # [Hz] of detections


def camera_cpu_percent() -> Figure:
    """CPU [% of a core] of the camera's process that hands on JPEGs at 15 Hz; drawing them is the reference."""
    handed, drawn = cost(is_virtual=False), cost(is_virtual=True)
    together = quantile(handed.camera, 0.5) + quantile(handed.detector, 0.5)
    note = f"640 x 480 at {RATE:g} Hz; with the detector that looks at every image {together:.1f}, the goal of both"
    reference = {"virtual camera, nothing moves": quantile(drawn.camera, 0.5)}
    figure = of_samples(handed.camera, reference=reference, note=note)
    return replace(figure, goal=f"both <= {MOST:g}", met=together <= MOST)


def detector_cpu_percent() -> Figure:
    """CPU [% of a core] of the detector that looks at every image of the sample cell at 15 Hz: tags, colours, boxes."""
    seen = cost(is_virtual=False)
    note = f"{seen.rate:.1f} images a second looked at; 2 tagged and 2 coloured things, 2 fixed tags"
    return of_samples(seen.detector, reference={f"at its usual {USUAL:g} a second": seen.usual}, note=note)


def image_to_detection_ms() -> Figure:
    """Time [ms] from an image's stamp to its detections in another process: camera, bus, detector, bus."""
    delays = cost(is_virtual=False).delays
    p95 = quantile(delays, 0.95)
    figure = of_samples(delays, note=f"{len(delays)} images of the sample cell, through the router; p95 {p95:.3g}")
    return replace(figure, goal=f"p95 <= {LATEST:g}", met=p95 <= LATEST)


@cache
def cost(is_virtual: bool) -> CameraCost:
    """A stack of its own with one camera."""
    with tempfile.TemporaryDirectory() as folder:
        cell = _cell(Path(folder), is_virtual)
        with Stack(processes=PROCESSES, environment={"GEMELO_ROBOT": "urdf/rm1", "GEMELO_CELL": str(cell)}) as stack:
            deployment = load_deployment(None, stack.environment)
            with Node("bench-eyes", deployment, robot="rm1") as node:
                return _measured(stack, node)


def _measured(stack: Stack, node: Node) -> CameraCost:
    delays: list[float] = []
    node.subscribe(camera_detections(CAMERA), lambda found: delays.append((time.time_ns() - found.stamp) * 1e-6))
    processes = families(stack)
    camera, detector = processes["camera"], processes["detector"]
    node.wait(SETTLE)
    (_, usual) = _shares(node, camera, detector)
    node.call(SET_RATE, SetParameter(name="rate", value=4.0 * RATE))
    node.wait(SETTLE)
    delays.clear()
    began = time.monotonic()
    shares = [_shares(node, camera, detector) for _ in range(WINDOWS)]
    rate = len(delays) / (time.monotonic() - began)
    if not delays:
        raise NotMeasured("no detection has come")
    return CameraCost([each for each, _ in shares], [each for _, each in shares], usual, delays, rate)


def _shares(node: Node, *families: list[psutil.Process]) -> list[float]:
    """[% of a core] that each took in a window."""
    before, began = [cpu_seconds(family) for family in families], time.monotonic()
    node.wait(WINDOW)
    lasted = time.monotonic() - began
    return [100.0 * (cpu_seconds(family) - spent) / lasted for family, spent in zip(families, before, strict=True)]


def _cell(folder: Path, is_virtual: bool) -> Path:
    """The sample cell with a camera of `RATE`, as it is or of stored images; its path."""
    text = (rm1().folder / "cell.toml").read_text("utf-8").replace("fps = 5.0", f"fps = {RATE}")
    if not is_virtual:
        camera, _ = virtual_camera()
        (folder / "images").mkdir()
        for index in range(IMAGES):
            (folder / "images" / f"{index:03}.jpg").write_bytes(camera.read().data)
        before, _, after = text.partition("[camera.source]\n")
        text = f"{before}[camera.source]\n{SOURCE}\n{after[after.index('# Fixed tags') :]}"
    path = folder / "cell.toml"
    path.write_text(text, "utf-8")
    return path


CAMERA = "overhead"  # of the sample cell
STEP = 0.002  # [rad] or [m] between two images, so that none is the one before
SENT = 150  # images
PERIOD = 1.0 / RATE  # [s]


def render_ms() -> Figure:
    """Time [ms] of one image of the sample cell with a moving arm, 640 x 480, two samples a side; and encoded."""
    cv2.setNumThreads(1)
    camera, world = virtual_camera()
    arm = rm1()
    camera.read()  # the rays of the lens are kept
    samples = []
    for index in range(IMAGES):
        position = tuple(value + STEP * index for value in arm.named_states["left"])
        world.on_joint_state(JointState(name=arm.joint_names, position=position))
        started = time.perf_counter()
        camera.read()
        samples.append((time.perf_counter() - started) * 1e3)
    reference = {"the same with nothing moving": still_ms(camera)}
    note = "sample cell of rm1, 640 x 480, lens distortion, blur, noise, JPEG; one thread"
    return of_samples(samples, None, reference, note)


def virtual_camera() -> tuple[VirtualCamera, CameraWorld]:
    """The camera of rm1's sample cell, and what it looks at."""
    arm = rm1()
    cell = load_cell(arm.folder / "cell.toml", arm)
    world, record = CameraWorld(arm, cell), cell.camera(CAMERA)
    assert isinstance(record.source, VirtualSource)
    return VirtualCamera(record, record.source, exact_info(record, arm.base_frame), world.snapshot), world


def still_ms(camera: VirtualCamera) -> float:
    """Time [ms] of an image of which only the noise is new."""
    started = time.perf_counter()
    for _ in range(IMAGES):
        camera.read()
    return (time.perf_counter() - started) * 1e3 / IMAGES


def image_path_ms(stacks: Stacks) -> Figure:
    """Time [ms] from the publication of a JPEG to the handler of another node, through the router at `RATE`."""
    running = stacks.any_broker()
    frame = virtual_camera()[0].read()
    arrived: list[float] = []
    topic = camera_image("bench")

    def on_image(message: CameraImage) -> None:
        arrived.append((time.time_ns() - message.stamp) * 1e-6)

    with Node("bench-camera", running.deployment, robot=running.arm.name) as sender:
        publisher = sender.publisher(topic)
        subscription = running.node.subscribe(topic, on_image)
        for _ in range(SENT):
            stamp = time.time_ns()
            publisher.put(
                CameraImage(stamp=stamp, camera="bench", width=frame.width, height=frame.height, data=frame.data)
            )
            running.node.wait(PERIOD)
        subscription.close()
    if not arrived:
        raise NotMeasured(f"of {SENT} images none has come")
    note = f"{len(frame.data) / 1e3:.0f} kB JPEG at {RATE:g} Hz, {len(arrived)} of {SENT} came"
    return of_samples(arrived, None, {}, note)
