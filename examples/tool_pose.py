"""Prints where the tool is every half second; warns, without dying, while its frame does not exist."""

from schemas.topics import FRAMES, STATIC_FRAMES
from services.arm.frames import FrameBuffer, FrameError
from services.runtime.node import Node

BASE, TOOL = "base_link", "efector_link"

with Node("tool_pose") as node:
    frames = FrameBuffer()
    node.subscribe(FRAMES, frames.insert_all)
    node.subscribe(STATIC_FRAMES, lambda message: frames.insert_all(message, is_static=True))

    def show(now: int) -> None:
        try:
            x, y, z = frames.look_up(BASE, TOOL).translation
        except FrameError as error:
            node.log.warning("%s", error)
        else:
            print(f"x {x:+.4f}  y {y:+.4f}  z {z:+.4f} m", flush=True)

    node.wait(0.3)  # for the first of them
    node.spin(show, rate=2.0)
