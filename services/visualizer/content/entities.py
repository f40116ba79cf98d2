"""The entity paths of the viewer; of several arms in one view, each has all of its own under its robot's name."""

from __future__ import annotations

TIMELINE = "time"
WORLD = "world"
MEASURED = f"{WORLD}/measured"
COMMANDED = f"{WORLD}/commanded"
PATH = f"{WORLD}/planned_path"
TRAIL = f"{WORLD}/tool_trail"
SCENE = f"{WORLD}/scene"
PLANNED = f"{WORLD}/planned"
REFUSED = f"{WORLD}/refused"
CONTACTS = f"{REFUSED}/contacts"
MODE = "device/mode"
PANEL = "device/panel"
LOG = "log"
STORY = "story"
JOINTS = "joints"


def under(robot: str, entity: str) -> str:
    """The entity of that robot among several; without a name it is the only one."""
    return f"{part(robot)}/{entity}" if robot else entity


def attached(root: str, link: str) -> str:
    """The entity of the objects attached to a link of the arm under `root`; `link` as in `VisualModel.paths`."""
    return f"{root}/{link}/carried"


def part(name: str) -> str:
    """Any text as one part of an entity's path, as Rerun escapes it."""
    return "".join(letter if letter.isalnum() or letter in "-_." else _escaped(letter) for letter in name)


def _escaped(letter: str) -> str:
    return f"\\{letter}" if letter.isascii() and letter.isprintable() else f"\\u{{{ord(letter):04X}}}"


def camera_pose(link: str, camera: str) -> str:
    """The optical frame of a camera that a link carries; `link` as in `VisualModel.paths`."""
    return f"{MEASURED}/{link}/camera_{camera}"


def camera_picture(camera: str) -> str:
    """The images of a camera. Apart from the arm, so that the view of an image is the same wherever the camera is."""
    return f"cameras/{camera}"


def found_in(camera: str) -> str:
    """Outlines of what was found in a camera's image."""
    return f"{camera_picture(camera)}/found"


def believed(camera: str) -> str:
    """The places in the base of what a camera has found."""
    return f"{WORLD}/found/{camera}"


def position(joint: str) -> str:
    """Two series: commanded, executed."""
    return f"{JOINTS}/{joint}/position"


def commanded(joint: str) -> str:
    return f"{position(joint)}/commanded"


def executed(joint: str) -> str:
    return f"{position(joint)}/executed"


def error(joint: str) -> str:
    """Three series: the step error and both edges of its band."""
    return f"{JOINTS}/{joint}/step_error"


def shaft(joint: str) -> str:
    """One series, in the same plot: how far the true shaft of a virtual device is from its counter."""
    return f"{error(joint)}/shaft"
