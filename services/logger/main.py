"""`gemelo-logger`: every recorded topic to MCAP, every command to CSV, and the black box, while there is a disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gemelo.libraries.arm.cell.cell_file import deployed_cell
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.incidents import FOLDER, Incident
from gemelo.libraries.recordings.origin import metadata_of
from gemelo.libraries.recordings.subscriptions import Subscriptions
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.priority import lower_priority
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.message import Message
from gemelo.schemas.topics import Topic
from gemelo.services.logger.black_box import BlackBox, BlackBoxWriter, SavingMark
from gemelo.services.logger.core import Batch, Logger
from gemelo.services.logger.disk import LoggerParameters, RecordingWriter
from gemelo.services.logger.images import record_cameras

# With those who supervise it the logger has 5 s to end. On a busy machine it comes after all others: 2 s are too few.
GRACE = 4.0  # [s] to end the recording, the black box and the session
LAST_BLACK_BOX = 1.5  # [s] of that for a black box that is being written; what is written by then can be read
WRITE_RATE = 2.0  # [Hz] a batch and an MCAP chunk each: what a kill -9 can cost


def run(node: Node, deployment: Deployment) -> None:
    """Collect between writes; the disk's problem shows in the readiness and in the log."""
    parameters = node.parameters(LoggerParameters)
    logger = Logger()
    metadata = metadata_of(node.robot, deployment, project_root())
    cameras = deployed_cell(deployment).camera_names
    disk = RecordingWriter(node.robot, metadata, node.log.warning)
    black_box, saver = BlackBox(), BlackBoxWriter(node.robot, metadata, node.log.warning, cameras)

    def on_message(topic: Topic[Any], message: Message) -> None:
        now = node.now()
        logger.on_message(topic, message, now)
        black_box.on_message(topic, message, now)

    Subscriptions(node, on_message)
    record_cameras(node, cameras, lambda: parameters.value.image_rate, on_message)
    said = ""

    def write(now: int, batch: Batch) -> None:
        nonlocal said
        present = parameters.value
        if present.enable_logging:
            disk.write(logger, batch, _folder(deployment, present), present, now, node.monotonic())
        else:
            disk.close()
        if logger.losses.sentence != said:
            said = logger.losses.sentence
            node.log.warning(said)

    def save(told: tuple[Incident, tuple[Entry, ...]] | None) -> None:
        keep = parameters.value.keep_black_boxes
        if told is not None and keep:
            saver.save(*told, project_root() / deployment.paths.out / FOLDER, keep)

    mark = SavingMark(project_root() / deployment.paths.out / FOLDER, node.robot)
    node.at_end(lambda: mark.show(False))

    def step(now: int) -> None:
        write(now, logger.step(now))
        save(black_box.step(now, node.router))
        mark.show(parameters.value.keep_black_boxes > 0 and (black_box.is_pending or saver.is_writing))
        node.set_ready(disk.problem is None, disk.problem or "")

    node.spin(step, rate=WRITE_RATE)
    now = node.now()
    save(black_box.finish(now))
    write(now, logger.finish(now))
    disk.close()
    saver.wait(LAST_BLACK_BOX)


def _folder(deployment: Deployment, parameters: LoggerParameters) -> Path:
    """The folder of the recordings: the parameter `log_dir`, relative to the project, or the deployment's own."""
    chosen = Path(parameters.log_dir) if parameters.log_dir else Path(deployment.paths.out) / "recordings"
    return project_root() / chosen


def main() -> None:
    """Entry point."""
    lower_priority()
    service("logger", run, grace=GRACE)


if __name__ == "__main__":
    main()
