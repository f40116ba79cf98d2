"""`python -m gemelo.services.visualizer.recorded FILE`: a recording in the twin's view; a black box at its incident.

What is drawn is made from the messages alone, by the same core that draws the living arm.
"""

from __future__ import annotations

import argparse
import base64
import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import rerun as rr

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.foxglove import CAMERA, IMAGE
from gemelo.libraries.recordings.incidents import Incident, in_language, incident_in
from gemelo.libraries.recordings.reader import BadRecording, RecordingReader, Row
from gemelo.libraries.recordings.shadow import recorded_robot, shadow_folder, write_shadow
from gemelo.libraries.recordings.view_layout import LAYOUT, ViewLayout
from gemelo.libraries.runtime.deployment import DeploymentError, project_root
from gemelo.libraries.runtime.process.own_files import make_own
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.camera import CameraImage
from gemelo.schemas.deployment import ViewerMode
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.reasons import Reason, because, plain, say
from gemelo.schemas.reasons.catalogue import ENGLISH, languages
from gemelo.schemas.scene import MeshShape, PlanningScene, SceneMesh
from gemelo.schemas.scene_meshes import with_meshes
from gemelo.schemas.topics import DESCRIPTION, SCENE
from gemelo.schemas.topics import scene_mesh as mesh_topic
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.feeds import feeds
from gemelo.services.visualizer.model.mesh_files import scene_mesh
from gemelo.services.visualizer.model.triangle_meshes import ShadedMesh
from gemelo.services.visualizer.model.urdf import parse_urdf, tool_link
from gemelo.services.visualizer.program.rerun_program import LOOPBACK, free_port, rerun_binary, start, stop
from gemelo.services.visualizer.program.screenshot import save_screenshot
from gemelo.services.visualizer.render.layout import ArmLayout, OpeningMoment, blueprint
from gemelo.services.visualizer.render.sink import APPLICATION, Sink
from gemelo.services.visualizer.viewer import address, resolved

BATCH = 100_000_000  # [ns] of the recording that are drawn together, as live
PERIOD = 0.5  # [s] between two looks at the viewer


def write_view(file: Path, rrd: Path, shadow: Path, language: str = ENGLISH) -> Incident | None:
    """Writes the recording `file` as the view `rrd`; returns the incident, if it is a black box.

    Its story stands beside it in `language`. The robot's files as they were recorded are written to the folder
    `shadow`. Raises `BadRecording` or OSError.
    """
    reader = RecordingReader(file)
    robot = recorded_robot(reader)
    write_shadow(reader, shadow, robot, project_root() / "urdf" / robot)
    incident = incident_in(reader)
    description = _description_in(reader)
    chosen = reader.read_record(LAYOUT, ViewLayout) or ViewLayout()
    cameras = tuple(sorted({*chosen.cameras, *_cameras_in(reader)}))
    folders = (shadow, project_root())
    try:
        core = _core(description, folders, language)
        taken = _takers(core, shadow, cameras, _meshes_in(reader))
    except (DescriptionError, ValueError) as error:
        raise BadRecording(because("recording.robot.not_drawn", _why(error), file=str(file))) from error
    stream = rr.RecordingStream(APPLICATION, recording_id=file.stem)
    rrd.parent.mkdir(parents=True, exist_ok=True)
    make_own(rrd)
    stream.save(rrd)
    moment = None if incident is None else OpeningMoment(incident.stamp, story_text(in_language(incident, language)))
    layout = blueprint(ArmLayout(core.model, chosen.window, chosen.trail, cameras, language=language), moment)
    sink = Sink(stream, core.model, shadow, layout, story="" if moment is None else moment.story, language=language)
    drawn = 0
    for row in reader.rows(taken.__contains__):
        if row.message.log_time - drawn > BATCH:
            drawn = row.message.log_time
            sink.write(core.step(drawn))
        taken[row.channel.topic](row)
    sink.write(core.step(drawn + BATCH))
    sink.close(timeout=30.0)
    return incident


def story_text(incident: Incident) -> str:
    """The incident as Markdown."""
    margins = "".join(f"- {each}\n" for each in incident.margins)
    story = "".join(f"| {each.at:+.2f} s | {_cell(each.text)} |\n" for each in incident.story)
    return f"### {incident.sentence}\n\n{margins}\n| | |\n|--:|:--|\n{story}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _description_in(reader: RecordingReader) -> RobotDescription:
    for row in reader.rows(DESCRIPTION.key.__eq__):
        return msgspec.json.decode(row.message.data, type=RobotDescription)
    raise BadRecording(because("recording.robot.no_description", file=str(reader.path)))


def _cameras_in(reader: RecordingReader) -> tuple[str, ...]:
    """Those of which there are images."""
    before, _, after = f"{CAMERA}/{IMAGE}".partition("{}")
    topics = {row.channel.topic for row in reader.rows(lambda topic: topic.startswith(before))}
    return tuple(sorted(topic[len(before) : -len(after)] for topic in topics if topic.endswith(after)))


def _meshes_in(reader: RecordingReader) -> dict[str, bytes]:
    """The files of the meshes of all its scenes, by digest."""
    before = mesh_topic("").key
    rows = reader.rows(lambda topic: topic.startswith(before))
    meshes = (msgspec.json.decode(row.message.data, type=SceneMesh) for row in rows)
    return {mesh.digest: mesh.data for mesh in meshes}


def _core(description: RobotDescription, folders: tuple[Path, ...], language: str) -> Visualizer:
    model = parse_urdf(description.urdf)

    def load(shape: MeshShape) -> ShadedMesh | None:
        return scene_mesh(shape, folders, lambda text: print(text, file=sys.stderr))

    return Visualizer(model, description.robot, tool_link(model, description.robot_toml), load, language)


def _takers(
    core: Visualizer, folder: Path, cameras: tuple[str, ...], meshes: dict[str, bytes]
) -> dict[str, Callable[[Row], None]]:
    """Who takes a row of each topic; one that is not as its message should be is left out."""
    found: dict[str, Callable[[Row], None]] = {}
    for topic, take, _ in feeds(core, load_arm(folder), cameras):
        found[topic.key] = _decoding(topic.message, take)
    found[SCENE.key] = _decoding(PlanningScene, lambda scene: core.scene.on_scene(with_meshes(scene, meshes)))
    for name in cameras:
        found[f"{CAMERA}/{IMAGE}".format(name)] = _decoding_image(name, core.cameras.on_image)
    return found


def _decoding(kind: type[Any], take: Callable[[Any], None]) -> Callable[[Row], None]:
    decoder = msgspec.json.Decoder(kind)

    def take_row(row: Row) -> None:
        try:
            message = decoder.decode(row.message.data)
        except (msgspec.DecodeError, msgspec.ValidationError):
            return
        take(message)

    return take_row


def _decoding_image(camera: str, take: Callable[[CameraImage], None]) -> Callable[[Row], None]:
    def take_row(row: Row) -> None:
        recorded = msgspec.json.decode(row.message.data)
        take(CameraImage(stamp=row.message.log_time, camera=camera, data=base64.b64decode(recorded["data"])))

    return take_row


def _why(error: Exception) -> Reason:
    return error.reason if isinstance(error, ReasonedError) else plain(str(error))


def show(rrd: Path, stopping: threading.Event) -> int:
    """Runs a viewer of its own on `rrd` until it is closed, or asked to stop; returns its exit code."""
    deployment = load_started()
    mode = resolved(ViewerMode.AUTO, os.environ)
    viewer = msgspec.structs.replace(deployment.viewer, host=LOOPBACK, port=free_port(), web_port=free_port())
    command = [str(rerun_binary()), str(rrd), "--bind", viewer.host, "--port", str(viewer.port)]
    if mode is ViewerMode.WEB:
        command += ["--serve-web", "--web-viewer-port", str(viewer.web_port)]
    child = start(command)
    try:
        print(f"{address(viewer, mode)}; Ctrl-C ends it", flush=True)
        while not stopping.wait(PERIOD) and child.poll() is None:
            pass
        return child.poll() or 0
    finally:
        stop(child)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="gemelo blackbox open", description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--save", type=Path, metavar="FILE", help="write the view as an .rrd there, and open none")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="save a PNG of the view, and open none")
    parser.add_argument("--lang", choices=languages(), default=ENGLISH, help="the language of the view and its story")
    options = parser.parse_args()
    stopping = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.set())
    try:
        deployment = load_started()
        out = project_root() / deployment.paths.out
        rrd = options.save or out / "views" / f"{options.file.stem}.rrd"
        incident = write_view(options.file, rrd, shadow_folder(out, options.file.stem), options.lang)
        if options.picture is not None:
            print(save_screenshot(rrd, options.picture, at=None if incident is None else incident.stamp))
        if options.save is not None:
            print(rrd)
        if options.picture is None and options.save is None:
            sys.exit(show(rrd, stopping))
    except (BadRecording, DeploymentError, RuntimeError, OSError) as error:
        sys.exit(f"gemelo: {say(_why(error), options.lang)}")


if __name__ == "__main__":
    main()
