"""A node: prints where the tool is every half second; warns, without dying, while its frame does not exist."""

from pathlib import Path

from gemelo import Node, topics
from gemelo.libraries.arm.frames.frame_buffer import FrameBuffer, FrameError
from gemelo.libraries.arm.model.description import load_arm

with Node("tool_pose") as node:
    arm, frames = load_arm(Path(node.deployment.robot)), FrameBuffer()
    node.subscribe(topics.FRAMES, frames.insert_all)
    node.subscribe(topics.STATIC_FRAMES, lambda message: frames.insert_all(message, is_static=True))

    def show(now: int) -> None:
        try:
            x, y, z = frames.look_up(arm.base_frame, arm.tool_frame).translation
        except FrameError as error:
            node.log.warning("%s", error)
        else:
            print(f"x {x:+.4f}  y {y:+.4f}  z {z:+.4f} m", flush=True)

    node.wait(0.3)  # for the first of them
    node.spin(show, rate=2.0)
