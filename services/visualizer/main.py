"""`gemelo-visualizer`: what the arm does, as columns for the Rerun viewer, a recording, or both."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from gemelo.libraries.arm.cell.cell_file import deployed_cell
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import deployments_beside, project_root, robot_name
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.node_clock import NodeClock
from gemelo.libraries.runtime.process.priority import lower_priority
from gemelo.libraries.runtime.scene_meshes import SceneMeshes
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.plain_text import ENGLISH, known, of_environment
from gemelo.schemas.scene import MeshShape
from gemelo.schemas.text_file import read_text
from gemelo.schemas.topics import ANY, DESCRIPTION, LOG, SCENE
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.feeds import feeds
from gemelo.services.visualizer.model.mesh_files import missing_meshes, scene_mesh
from gemelo.services.visualizer.model.triangle_meshes import ShadedMesh
from gemelo.services.visualizer.model.urdf import parse_urdf, tool_link
from gemelo.services.visualizer.render.arms_layout import SharedView
from gemelo.services.visualizer.render.layout import ArmLayout
from gemelo.services.visualizer.render.outputs import Outputs, VisualizerParameters

BATCH_RATE = 10.0  # [Hz]


def run(node: Node, deployment: Deployment) -> None:
    """Wait for the description, then show everything in batches."""
    root = project_root()
    cameras = deployed_cell(deployment).camera_names
    parameters = node.parameters(VisualizerParameters).value
    language = view_language(deployment.viewer.language, os.environ, node.log)
    shared = _shared_view(node, deployment, parameters, language)
    outputs = Outputs(deployment.viewer, root / deployment.robot, root, parameters, cameras, shared)
    visualizer: Visualizer | None = None

    def on_description(message: RobotDescription) -> None:
        nonlocal visualizer
        if visualizer is None:
            try:
                visualizer = _visualizer(node, message, (root, root / deployment.robot), cameras, language)
            except ValueError as error:
                node.log.error(f"the description of {message.robot} cannot be drawn: {error}")
                return
            for name in missing_meshes(visualizer.model, root / deployment.robot):
                node.log.warning(f"mesh {name} is missing in {root / deployment.robot}: its link is drawn without it")

    def step(now: int) -> None:
        if visualizer is None:
            node.set_ready(False, "no robot description yet: is state_publisher running?")
            return
        problem = outputs.step(visualizer, now, node.monotonic())
        node.set_ready(not problem, problem)

    node.subscribe(DESCRIPTION, on_description)
    node.spin(step, rate=BATCH_RATE)
    outputs.close()


def _shared_view(
    node: Node, deployment: Deployment, parameters: VisualizerParameters, language: str
) -> SharedView | None:
    """The view of several arms on this machine; None where this one has a viewer of its own."""
    layouts = []
    for each in deployments_beside(deployment):
        arm = load_arm(Path(each.robot))
        try:
            model = parse_urdf(read_text(arm.urdf_path))
        except ValueError as error:
            node.log.error(f"{arm.name} is left out of the view of all arms, as it cannot be drawn: {error}")
            continue
        cameras = deployed_cell(each).camera_names
        layouts.append(ArmLayout(model, parameters.window, parameters.trail, cameras, arm.name, language))
    return SharedView(robot_name(deployment), tuple(layouts)) if layouts else None


def _visualizer(
    node: Node, message: RobotDescription, folders: tuple[Path, ...], cameras: tuple[str, ...], language: str
) -> Visualizer:
    """The core for the arm that was described, fed from the bus; the scene's mesh files are in `folders`."""
    model = parse_urdf(message.urdf)

    def load(shape: MeshShape) -> ShadedMesh | None:
        return scene_mesh(shape, folders, node.log.warning)

    core = Visualizer(model, message.robot, tool_link(model, message.robot_toml), load, language)
    clocks: dict[str, NodeClock] = {}
    for topic, take, is_series in feeds(core, load_arm(folders[-1]), cameras):
        if topic.writer != ANY and "stamp" in topic.message.__struct_fields__:
            clock = clocks.get(topic.writer) or clocks.setdefault(topic.writer, NodeClock(node, topic.writer))
            take = by_own_clock(clock, take)
        if topic is SCENE:
            take = SceneMeshes(node, take).on_scene
        node.subscribe(topic, take, own=topic is LOG, batch=1 / BATCH_RATE if is_series else None)
    return core


def view_language(wanted: str, environ: Mapping[str, str], log: logging.Logger) -> str:
    """The language of the view: that of `[viewer] language`, else of the locale; English where there is no such one."""
    if not wanted:
        return of_environment(environ)
    if wanted in known():
        return wanted
    log.warning(f"[viewer] language is {wanted!r}: the view is in English; there are {', '.join(known())}")
    return ENGLISH


def by_own_clock(clock: NodeClock, take: Callable[[Any], object]) -> Callable[[Any], None]:
    """`take` with stamps by this host's clock, on which the whole view is; as they are before it is known."""

    def taken(message: Any) -> None:
        stamp = clock.to_own(message.stamp)
        take(message if stamp in (None, message.stamp) else replace(message, stamp=stamp))

    return taken


def main() -> None:
    """Entry point."""
    lower_priority()
    service("visualizer", run)


if __name__ == "__main__":
    main()
