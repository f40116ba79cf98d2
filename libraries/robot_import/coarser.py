"""A mesh of too many triangles made coarser: corners in one cell of a grid become one corner, their mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import trimesh

# Tuning constants: chosen, where a line does not say measured or standard.
CELLS = 400  # along the longest side, at first: a quarter of a millimetre in a link of a hand's length
FEWER = 0.75  # of them, until there are few enough triangles


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
