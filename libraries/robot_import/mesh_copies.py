"""The meshes of an imported arm, below its own folder under names that every program takes."""

from __future__ import annotations

import shutil
from pathlib import Path

from gemelo.libraries.arm.checks.meshes import MOST_TRIANGLES, MeshFacts, facts_of, scene_of
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.robot_import.coarser import coarser
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import safe_name

KEPT = (".stl", ".glb")  # the viewer, the page and the fitting read these; other formats become .glb
MOST_COARSER = MOST_TRIANGLES // 5  # triangles of a copy that is made coarser
NOT_IN_A_FILE = r"[^a-z0-9_-]+"


def copy_meshes(mended: Mended, folder: Path) -> int:
    """Copies every mesh that the elements name into `folder`/meshes, rewrites their references, returns the number."""
    names: dict[Path, str] = {}
    known: set[str] = set()
    for mesh in mended.xml.root.iter("mesh"):
        reference = mesh.get("filename", "")
        file = mended.files[reference]
        if file not in names:
            names[file] = _copy(file, folder / "meshes", safe_name(file.stem.lower(), known, NOT_IN_A_FILE))
        mesh.set("filename", f"meshes/{names[file]}")
    return len(names)


def _copy(file: Path, folder: Path, stem: str) -> str:
    """The name in `folder`; raises `DescriptionError` for what trimesh cannot read."""
    folder.mkdir(exist_ok=True)
    ending = file.suffix.lower()
    known = facts_of(file)
    if isinstance(known, MeshFacts) and known.triangles > MOST_TRIANGLES:
        mesh, _ = coarser(scene_of(file).to_mesh(), MOST_COARSER)
        mesh.export(folder / f"{stem}.stl")
        return f"{stem}.stl"
    if ending in KEPT:
        shutil.copyfile(file, folder / f"{stem}{ending}")
        return f"{stem}{ending}"
    try:
        scene_of(file).export(folder / f"{stem}.glb")
    except Exception as error:  # whatever its many readers raise for a damaged file
        raise DescriptionError(f"{file} cannot be read: {error}") from error
    return f"{stem}.glb"
