"""The arm as viser draws it, more than once: as it is measured, as the goal, and as the plan plays it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import viser
import yourdfpy
from numpy.typing import NDArray
from viser.extras import ViserUrdf

Array = NDArray[np.float64]
Color = tuple[float, float, float, float]  # red, green, blue and opacity, each 0 to 1

UNSEEN = 1e-5  # [rad] or [m] less of a joint is not drawn anew


class DrawnArm:
    """One arm under the scene's node `name`; `color` paints all of it, else it has the URDF's colours."""

    def __init__(self, server: viser.ViserServer, path: Path, name: str, color: Color | None = None) -> None:
        self._model = load_model(path)
        self._root = server.scene.add_frame(name, show_axes=False)
        self._drawn = ViserUrdf(server, self._model, root_node_name=name, mesh_color_override=color)
        self._names = self._model.actuated_joint_names
        self._shown: Array = np.zeros(0)

    @property
    def is_visible(self) -> bool:
        return bool(self._root.visible)

    @is_visible.setter
    def is_visible(self, visible: bool) -> None:
        if self._root.visible != visible:
            self._root.visible = visible

    def show(self, joints: Mapping[str, float]) -> bool:
        """Joint values [rad] or [m] by name; False where it stands so already."""
        values = np.array([joints.get(name, 0.0) for name in self._names])
        if self._shown.shape == values.shape and float(np.abs(values - self._shown).max(initial=0.0)) < UNSEEN:
            return False
        self._shown = values
        self._drawn.update_cfg(values)
        return True

    def pose(self, link: str) -> Array:
        """(4, 4) where `link` is in the base's frame, as the arm is drawn."""
        return np.asarray(self._model.get_transform(link), dtype=float)


def load_model(path: Path) -> yourdfpy.URDF:
    """The URDF with the meshes that lie beside it."""
    handler = partial(yourdfpy.filename_handler_magic, dir=str(path.parent))
    return yourdfpy.URDF.load(str(path), filename_handler=handler)
