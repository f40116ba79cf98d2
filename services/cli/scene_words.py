"""What the shell may complete after `gemelo scene`: links, and objects of the scene that the planner keeps."""

from __future__ import annotations

from pathlib import Path

from services.cli.exits import CommandError
from services.cli.parser import Words

KEPT = "scene.json"  # in the run folder; the planner writes it


def objects() -> Words:
    """The names of the objects; nothing where the file cannot be read."""
    return {"": _objects()}


def objects_and_links() -> Words:
    """An object, then a link."""
    names = _objects()
    return {"": names, **dict.fromkeys(names, _links())}


def pairs() -> Words:
    """Two of anything."""
    names = [*_objects(), *_links()]
    return {"": names, **dict.fromkeys(names, names)}


def _objects() -> list[str]:
    from services.cli.scene import load
    from services.cli.session import load as load_session
    from services.runtime.deployment import project_root

    try:
        deployment, _ = load_session()
        scene = load(project_root() / Path(deployment.paths.run) / KEPT)
    except CommandError:
        return []
    return [item.name for item in scene.objects if " " not in item.name]


def _links() -> tuple[str, ...]:
    from services.cli.device_words import arm

    known = arm()
    return known.model.link_names if known else ()
