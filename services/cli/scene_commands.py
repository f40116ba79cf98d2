"""Commands about the planning scene: add, remove, move, resize, attach, detach, allow, list, load, save, clear."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from services.cli.exits import ExitCode
from services.cli.parser import Command, Options, Parser, Words, json_option, positive_number

if TYPE_CHECKING:
    from schemas.scene import SceneRequest

GROUPS = {"scene": "what stands around the arm, and what it carries"}
ADD_EXAMPLES = """examples:
  gemelo scene add table --box 600mm 400mm 20mm --at 300mm 0 -10mm
  gemelo scene add floor --plane --at 0 0 -20mm
  gemelo scene add vice --mesh parts/vice.stl --scale 0.001 --at 250mm 100mm 0 --rpy 0 0 90deg
  gemelo scene add cup --cylinder 30mm 80mm --attach efector_link --at 0 0 40mm"""
NAME, LINK, XYZ, ZEROS = "NAME", "LINK", ("X", "Y", "Z"), ("0", "0", "0")


def name_option(parser: Parser) -> None:
    parser.add_argument("name", metavar=NAME, help="an object of `gemelo scene list`")


def shape_options(parser: Parser) -> None:
    shape = parser.add_mutually_exclusive_group(required=True)
    shape.add_argument("--box", nargs=3, metavar=XYZ, help="its edges, as 300mm or 0.3")
    shape.add_argument("--sphere", metavar="RADIUS", help="as 50mm or 0.05")
    shape.add_argument("--cylinder", nargs=2, metavar=("RADIUS", "LENGTH"), help="along its z axis")
    shape.add_argument("--plane", action="store_true", help="all below its z = 0 is solid")
    shape.add_argument("--mesh", metavar="STL", help="an STL file")
    parser.add_argument("--scale", type=positive_number, default=1.0, help="metres per unit of the STL file")


def place_options(parser: Parser, required: bool = False) -> None:
    parser.add_argument("--at", nargs=3, default=ZEROS, required=required, metavar=XYZ, help="where, as 300mm or 0.3")
    parser.add_argument(
        "--rpy", nargs=3, default=ZEROS, metavar=("R", "P", "Y"), help="how turned, as 90deg or 1.57rad"
    )
    parser.add_argument("--frame", default="", metavar=LINK, help="in which this is given, as it is now; else the base")


def touch_option(parser: Parser) -> None:
    parser.add_argument("--touch", nargs="+", default=[], metavar=LINK, help="links that it may touch while carried")


def add_options(parser: Parser) -> None:
    parser.epilog = ADD_EXAMPLES
    parser.add_argument("name", metavar=NAME, help="one of that name is replaced")
    shape_options(parser)
    place_options(parser)
    parser.add_argument("--attach", metavar=LINK, help="it is carried by this link, and its place is in it")
    touch_option(parser)
    parser.add_argument("--padding", default="0", metavar="DISTANCE", help="kept around it besides the clearance")


def add(options: Options) -> ExitCode:
    from schemas.scene import SceneAdd, SceneRequest
    from services.cli.scene_shape import object_of

    return ask(SceneRequest(edit=SceneAdd(object=object_of(options))))


def ask(request: SceneRequest) -> ExitCode:
    from services.cli.scene import edit
    from services.cli.session import connect

    with connect() as session:
        return edit(session, request)


def remove(options: Options) -> ExitCode:
    from schemas.scene import SceneRemove, SceneRequest

    return ask(SceneRequest(edit=SceneRemove(name=options.name)))


def move_options(parser: Parser) -> None:
    name_option(parser)
    place_options(parser, required=True)


def move(options: Options) -> ExitCode:
    from schemas.scene import SceneMove, SceneRequest
    from services.cli.scene_shape import pose_of

    pose = pose_of(options.at, options.rpy)
    return ask(SceneRequest(edit=SceneMove(name=options.name, pose=pose, frame=options.frame)))


def resize_options(parser: Parser) -> None:
    name_option(parser)
    shape_options(parser)


def resize(options: Options) -> ExitCode:
    from schemas.scene import SceneRequest, SceneResize
    from services.cli.scene_shape import shape_of

    return ask(SceneRequest(edit=SceneResize(name=options.name, shape=shape_of(options))))


def attach_options(parser: Parser) -> None:
    name_option(parser)
    parser.add_argument("link", metavar=LINK, help="that carries it from now on")
    touch_option(parser)


def attach(options: Options) -> ExitCode:
    from schemas.scene import SceneAttach, SceneRequest

    touch_links = tuple(options.touch)
    return ask(SceneRequest(edit=SceneAttach(name=options.name, link=options.link, touch_links=touch_links)))


def detach(options: Options) -> ExitCode:
    from schemas.scene import SceneDetach, SceneRequest

    return ask(SceneRequest(edit=SceneDetach(name=options.name)))


def pair_options(parser: Parser) -> None:
    parser.add_argument("first", metavar="FIRST", help='a link or an object; "*" is any')
    parser.add_argument("second", metavar="SECOND", help='another one; "*" is any')


def allow(options: Options) -> ExitCode:
    from schemas.scene import AllowedPair, SceneAllow, SceneRequest

    pair = AllowedPair(first=options.first, second=options.second)
    return ask(SceneRequest(edit=SceneAllow(pair=pair)))


def disallow(options: Options) -> ExitCode:
    from schemas.scene import AllowedPair, SceneDisallow, SceneRequest

    pair = AllowedPair(first=options.first, second=options.second)
    return ask(SceneRequest(edit=SceneDisallow(pair=pair)))


def show(options: Options) -> ExitCode:
    import msgspec

    from services.cli.scene import listing, present
    from services.cli.session import connect

    with connect() as session:
        scene = present(session)
    print(msgspec.json.encode(scene).decode() if options.json else listing(scene))
    return ExitCode.OK


def file_option(parser: Parser) -> None:
    parser.add_argument("file", metavar="FILE", type=Path, help="a scene as JSON")


def load(options: Options) -> ExitCode:
    from schemas.scene import SceneReplace, SceneRequest
    from services.cli.scene import load

    return ask(SceneRequest(edit=SceneReplace(scene=load(options.file))))


def save(options: Options) -> ExitCode:
    from services.cli.scene import present, save
    from services.cli.session import connect

    with connect() as session:
        save(present(session), options.file)
    return ExitCode.OK


def clear(options: Options) -> ExitCode:
    from schemas.scene import SceneClear, SceneRequest

    return ask(SceneRequest(edit=SceneClear()))


def object_words() -> Words:
    from services.cli.scene_words import objects

    return objects()


def attach_words() -> Words:
    from services.cli.scene_words import objects_and_links

    return objects_and_links()


def pair_words() -> Words:
    from services.cli.scene_words import pairs

    return pairs()


COMMANDS = (
    Command(("scene", "add"), "put an object around the arm, or in its hand", add, add_options),
    Command(("scene", "remove"), "take an object away", remove, name_option, "gemelo scene remove table", object_words),
    Command(("scene", "move"), "put an object elsewhere", move, move_options,
            "gemelo scene move table --at 300mm 0 -20mm", object_words),
    Command(("scene", "resize"), "give an object another shape", resize, resize_options,
            "gemelo scene resize table --box 800mm 400mm 20mm", object_words),
    Command(("scene", "attach"), "let a link carry an object from where it is", attach, attach_options,
            "gemelo scene attach cup efector_link --touch antebrazo_link", attach_words),
    Command(("scene", "detach"), "leave a carried object where it is", detach, name_option,
            "gemelo scene detach cup", object_words),
    Command(("scene", "allow"), "let two things touch", allow, pair_options, "gemelo scene allow cup table",
            pair_words),
    Command(("scene", "disallow"), "take that back", disallow, pair_options, "gemelo scene disallow cup table",
            pair_words),
    Command(("scene", "list"), "all objects, and what may touch", show, json_option),
    Command(("scene", "load"), "replace the scene by a file's", load, file_option, "gemelo scene load cell.json"),
    Command(("scene", "save"), "write the scene into a file", save, file_option, "gemelo scene save cell.json"),
    Command(("scene", "clear"), "take everything away", clear),
)  # fmt: skip
