"""The meshes of an imported arm, below its own folder under names that every program takes, those of too many triangles
made coarser."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gemelo.libraries.arm.checks.meshes import MOST_TRIANGLES, MeshFacts, facts_of, scene_of
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import safe_name
from gemelo.schemas.reasons import because

if TYPE_CHECKING:
    import trimesh

KEPT = (".stl", ".glb")  # the viewer, the page and the fitting read these; other formats become .glb
MOST_COARSER = MOST_TRIANGLES // 5  # triangles of a copy that is made coarser
NOT_IN_A_FILE = r"[^a-z0-9_-]+"
# Tuning constants: chosen, where a line does not say measured or standard.
CELLS = 400  # along the longest side, at first: a quarter of a millimetre in a link of a hand's length
FEWER = 0.75  # of them, until there are few enough triangles


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
        raise DescriptionError(because("import.mesh.unreadable", file=str(file), problem=str(error))) from error
    return f"{stem}.glb"


def coarser(mesh: trimesh.Trimesh, most: int) -> tuple[trimesh.Trimesh, float]:
    """A mesh of at most so many triangles, and how far a corner has moved at the most, in the mesh's unit."""
    import trimesh  # half a second

    vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces)
    low, longest, cells = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max()), float(CELLS)
    while True:
        keys = np.floor((vertices - low) / (longest / cells)).astype(np.int64)
        _, numbers = np.unique(keys, axis=0, return_inverse=True)
        numbers = numbers.reshape(-1)
        sums = np.zeros((numbers.max() + 1, 3))
        np.add.at(sums, numbers, vertices)
        means = sums / np.bincount(numbers)[:, None]
        kept = numbers[faces]
        apart = (kept[:, 0] != kept[:, 1]) & (kept[:, 1] != kept[:, 2]) & (kept[:, 0] != kept[:, 2])
        kept = kept[apart]
        _, first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)
        kept = kept[np.sort(first)]
        if len(kept) <= most:
            moved = float(np.linalg.norm(means[numbers] - vertices, axis=1).max())
            return trimesh.Trimesh(means, kept, process=False), moved
        cells *= FEWER
