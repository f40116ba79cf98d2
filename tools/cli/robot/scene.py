"""`gemelo scene`: the objects around the arm, and those that it carries."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.scene import (
    AllowedPair,
    PlanningScene,
    SceneAdd,
    SceneAllow,
    SceneAttach,
    SceneClear,
    SceneDetach,
    SceneDisallow,
    SceneEdit,
    SceneMove,
    SceneRemove,
    SceneReplace,
    SceneResize,
)
from gemelo.tools.cli.bus.request_text import millimetres, understood
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm
from gemelo.tools.cli.parser import Choices, Options, Parser, positive_number
from gemelo.tools.cli.robot.scene_object import listing, object_of, place_text, pose_of, shape_of, sized_text

if TYPE_CHECKING:
    from gemelo import Robot

KEPT = "scene.json"  # in the run folder; the planner writes it
ADD_EXAMPLES = """examples:
  gemelo scene add table --box 600mm 400mm 20mm --at 300mm 0 -10mm
  gemelo scene add floor --plane --at 0 0 -20mm
  gemelo scene add vice --mesh parts/vice.stl --scale 0.001 --at 250mm 100mm 0 --rpy 0 0 90deg
  gemelo scene add cup --cylinder 30mm 80mm --attach efector_link --at 0 0 40mm"""
NAME, LINK, XYZ, ZEROS = "NAME", "LINK", ("X", "Y", "Z"), ("0", "0", "0")


def name_option(parser: Parser) -> None:
    """Adds the object's name."""
    parser.add_argument("name", metavar=NAME, help="an object of `gemelo scene list`")


def shape_options(parser: Parser) -> None:
    """Adds the shapes, one of which is required."""
    shape = parser.add_mutually_exclusive_group(required=True)
    shape.add_argument("--box", nargs=3, metavar=XYZ, help="its edges, as 300mm or 0.3")
    shape.add_argument("--sphere", metavar="RADIUS", help="as 50mm or 0.05")
    shape.add_argument("--cylinder", nargs=2, metavar=("RADIUS", "LENGTH"), help="along its z axis")
    shape.add_argument("--plane", action="store_true", help="all below its z = 0 is solid")
    shape.add_argument("--mesh", metavar="STL", help="an STL file")
    parser.add_argument("--scale", type=positive_number, default=None, help="metres per unit of the STL file [1]")


def place_options(parser: Parser, required: bool = False) -> None:
    """Adds position, rotation and frame."""
    parser.add_argument("--at", nargs=3, default=ZEROS, required=required, metavar=XYZ, help="where, as 300mm or 0.3")
    parser.add_argument(
        "--rpy", nargs=3, default=ZEROS, metavar=("R", "P", "Y"), help="how turned, as 90deg or 1.57rad"
    )
    parser.add_argument("--frame", default="", metavar=LINK, help="in which this is given, as it is now; else the base")


def touch_option(parser: Parser) -> None:
    """Adds --touch."""
    parser.add_argument("--touch", nargs="+", default=[], metavar=LINK, help="links that it may touch while carried")


def add_options(parser: Parser) -> None:
    """Adds name, shape, place and what carries it."""
    parser.epilog = ADD_EXAMPLES
    parser.add_argument("name", metavar=NAME, help="one of that name is replaced")
    shape_options(parser)
    place_options(parser)
    parser.add_argument("--attach", metavar=LINK, help="it is carried by this link, and its place is in it")
    touch_option(parser)
    parser.add_argument("--padding", default="0", metavar="DISTANCE", help="kept around it besides the clearance")


def add(options: Options) -> ExitCode:
    """Adds an object, or replaces the one of its name."""
    item = object_of(options)
    parts = [item.name, sized_text(item.shape), place_text(item.pose, item.frame)]
    if item.padding:
        parts.append(sentence(because("understood.padding", distance=millimetres([item.padding]))))
    print(understood(", ".join(parts)), flush=True)
    return ask(SceneAdd(object=item))


def ask(change: SceneEdit) -> ExitCode:
    """Connects, sends the change and prints the new version."""
    with connect_arm() as arm:
        response = arm.scene.edit(change)
    version = because("understood.scene.version", version=response.version)
    why = response.why or (plain(response.reason) if response.reason else None)
    print(sentence(version if why is None else because("understood.scene.version.but", version, why)))
    return ExitCode.OK


def remove(options: Options) -> ExitCode:
    """Removes an object."""
    return ask(SceneRemove(name=options.name))


def move_options(parser: Parser) -> None:
    """Adds name and place."""
    name_option(parser)
    place_options(parser, required=True)


def move(options: Options) -> ExitCode:
    """Moves an object."""
    pose = pose_of(options.at, options.rpy)
    print(understood(f"{options.name} {place_text(pose, options.frame)}"), flush=True)
    return ask(SceneMove(name=options.name, pose=pose, frame=options.frame))


def resize_options(parser: Parser) -> None:
    """Adds name and shape."""
    name_option(parser)
    shape_options(parser)


def resize(options: Options) -> ExitCode:
    """Gives an object another shape."""
    shape = shape_of(options)
    print(understood(f"{options.name}, {sized_text(shape)}"), flush=True)
    return ask(SceneResize(name=options.name, shape=shape))


def attach_options(parser: Parser) -> None:
    """Adds object, link and --touch."""
    name_option(parser)
    parser.add_argument("link", metavar=LINK, help="that carries it from now on")
    touch_option(parser)


def attach(options: Options) -> ExitCode:
    """Attaches an object to a link, at its present pose."""
    touch_links = tuple(options.touch)
    return ask(SceneAttach(name=options.name, link=options.link, touch_links=touch_links))


def detach(options: Options) -> ExitCode:
    """Detaches an object at its present pose."""
    return ask(SceneDetach(name=options.name))


def pair_options(parser: Parser) -> None:
    """Adds the two names."""
    parser.add_argument("first", metavar="FIRST", help='a link or an object; "*" is any')
    parser.add_argument("second", metavar="SECOND", help='another one; "*" is any')


def allow(options: Options) -> ExitCode:
    """Allows or disallows a pair, as the last word says."""
    pair = AllowedPair(first=options.first, second=options.second)
    is_allowed = options.command.words[-1] == "allow"
    return ask(SceneAllow(pair=pair) if is_allowed else SceneDisallow(pair=pair))


def show(options: Options) -> ExitCode:
    """Prints the scene."""
    with connect_arm() as arm:
        scene = arm.scene.present
    print(msgspec.json.encode(scene).decode() if options.json else listing(scene))
    return ExitCode.OK


def file_option(parser: Parser) -> None:
    """Adds the file."""
    parser.add_argument("file", metavar="FILE", type=Path, help="a scene as JSON")


def load(options: Options) -> ExitCode:
    """Replaces the scene by that of a file."""
    return ask(SceneReplace(scene=_read(options.file)))


def save(options: Options) -> ExitCode:
    """Writes the scene into a file."""
    from gemelo.api.scene_files import write_scene  # slow to load

    with connect_arm() as arm:
        scene = arm.scene.whole()
        write_scene(scene, options.file)
    print(sentence(because("understood.scene.saved", file=str(options.file), version=scene.version)))
    return ExitCode.OK


def clear(options: Options) -> ExitCode:
    """Removes every object and every allowed pair."""
    return ask(SceneClear())


def object_choices(robot: Robot | None) -> Choices:
    """The names of the objects."""
    return {"": _object_names(robot)}


def attach_choices(robot: Robot | None) -> Choices:
    """An object, then a link."""
    names = _object_names(robot)
    return {"": names, **dict.fromkeys(names, _link_names(robot))}


def pair_choices(robot: Robot | None) -> Choices:
    """Two objects or links."""
    names = [*_object_names(robot), *_link_names(robot)]
    return {"": names, **dict.fromkeys(names, names)}


def _object_names(robot: Robot | None) -> list[str]:
    """Those that the shell can complete, from the planner's file; none if it cannot be read."""
    from gemelo.libraries.runtime.deployment import project_root  # slow to load

    if robot is None:
        return []
    try:
        kept = _read(project_root() / Path(robot.deployment.paths.run) / KEPT)
    except CommandError:
        return []
    return [item.name for item in kept.objects if " " not in item.name]


def _link_names(robot: Robot | None) -> tuple[str, ...]:
    return robot.description.model.link_names if robot else ()


def _read(path: Path) -> PlanningScene:
    """The scene of a file; raises `CommandError` where it cannot be read, or holds none."""
    from gemelo.api.scene_files import read_scene  # slow to load

    try:
        return read_scene(path)
    except gemelo.Error as error:
        raise usage(error) from error
