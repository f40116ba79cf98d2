"""The planners of free motions: the table that the planner, the page, the command line, the documents and `gemelo`
read.

A planner is a row here and its search, a module of services/planner/path/searches.
"""

from __future__ import annotations

from typing import NamedTuple


class PlannerRow(NamedTuple):
    """One planner."""

    name: str  # `FreeMotion.planner_id`
    search: str  # its module; "" of the compiled core's own, which is asked first where none is chosen
    text: str  # what it can do
    text_es: str  # the same in Spanish

    def text_in(self, language: str) -> str:
        """What it can do, in "en" or "es"."""
        return self.text_es if language == "es" else self.text


PLANNERS = (
    PlannerRow(
        "native",
        "",
        "compiled RRT-Connect on spheres around the links: the fastest, cautious near things; takes `attempts`",
        "RRT-Connect compilado sobre esferas en torno a los eslabones: el más rápido, cauto cerca de las cosas; "
        "acepta `attempts`",
    ),
    PlannerRow(
        "RRTConnect",
        "ompl_trees",
        "OMPL: two trees on the exact shapes, and the first path; where the native planner finds none",
        "OMPL: dos árboles sobre las formas exactas, y el primer camino; donde el planificador nativo no halla ninguno",
    ),
    PlannerRow(
        "RRTstar",
        "ompl_trees",
        "OMPL: one tree on the exact shapes, bettered after its first path",
        "OMPL: un árbol sobre las formas exactas, mejorado tras su primer camino",
    ),
    PlannerRow(
        "BITstar",
        "ompl_trees",
        "OMPL: batches of samples on the exact shapes, bettered after the first path",
        "OMPL: tandas de muestras sobre las formas exactas, mejoradas tras el primer camino",
    ),
    PlannerRow(
        "PRM",
        "ompl_roadmap",
        "OMPL: a roadmap over all the joints can do, and the shortest path on it",
        "OMPL: un mapa de caminos sobre todo lo que pueden las juntas, y el camino más corto en él",
    ),
)
NATIVE, DEFAULT = "native", "RRTConnect"  # where none is chosen: the first, and the other where that finds nothing
NAMES = tuple(row.name for row in PLANNERS)


def planner_named(name: str) -> PlannerRow:
    """The row of that name; KeyError without one."""
    for row in PLANNERS:
        if row.name == name:
            return row
    raise KeyError(name)
