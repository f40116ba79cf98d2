"""Figures of the cameras: one image of the virtual one, and the way of an image over the bus."""

from __future__ import annotations

import time

import cv2

from schemas.camera import CameraImage
from schemas.cell import VirtualSource
from schemas.joints import JointState
from schemas.topics import camera_image
from services.arm.cell.camera_model import exact_info
from services.arm.cell.cell_file import load_cell
from services.bench.figures import Figure, NotMeasured, of_samples
from services.bench.scenes import rm1
from services.bench.stack import Stacks
from services.camera.virtual.virtual_camera import VirtualCamera
from services.camera.virtual.world import World
from services.runtime.node import Node

IMAGES = 30
CAMERA = "overhead"  # of the sample cell
STEP = 0.002  # [rad] or [m] between two images, so that none is the one before
RATE, SENT = 15.0, 150  # [Hz], images
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


def virtual_camera() -> tuple[VirtualCamera, World]:
    """The camera of rm1's sample cell, and what it looks at."""
    arm = rm1()
    cell = load_cell(arm.folder / "cell.toml", arm)
    world, record = World(arm, cell), cell.camera(CAMERA)
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
