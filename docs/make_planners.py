"""`make docs`: writes the pages of the planners, in both languages, from their table, gemelo.schemas.planners."""

from __future__ import annotations

from pathlib import Path

from gemelo.schemas.planners import DEFAULT, NATIVE, PLANNERS

HERE = Path(__file__).parent
EN = f"""# Planners

In Spanish: [Planificadores](es/planificadores.md). Made by `make docs` of
[schemas/planners.py](../schemas/planners.py).

A free motion, any way that touches nothing, is searched for by one of these: `gemelo move --planner NAME`,
`arm.move(planner="NAME")`, or *Planner* on the page. Where none is chosen, {NATIVE} is asked first, and {DEFAULT} where
that finds nothing; a joint path that is straight and free needs no search.

| name | what it can do |
|---|---|
"""
ES = f"""# Planificadores

En inglés: [Planners](../planners.md). Hecho por `make docs` de [schemas/planners.py](../../schemas/planners.py).

Un movimiento libre, por cualquier camino que no toque nada, lo busca uno de estos: `gemelo move --planner NOMBRE`,
`arm.move(planner="NOMBRE")`, o *Planificador* en la página. Donde no se elige ninguno se pregunta primero a {NATIVE},
y a {DEFAULT} donde ese no halla nada; un camino recto y libre de las juntas no necesita búsqueda.

| nombre | qué puede |
|---|---|
"""
ADDING = """
Adding one is a file in [services/planner/path/searches](../services/planner/path/searches) and a row of that table;
`tests/planner/test_new_planner.py` adds one.
"""
AGREGAR = """
Agregar uno es un archivo en [services/planner/path/searches](../../services/planner/path/searches) y una fila de esa
tabla; `tests/planner/test_new_planner.py` agrega uno.
"""


def pages() -> dict[Path, str]:
    """Their texts by file."""
    parts = ((HERE / "planners.md", "en", EN, ADDING), (HERE / "es/planificadores.md", "es", ES, AGREGAR))
    return {
        file: head + "".join(f"| `{row.name}` | {row.text_in(language)} |\n" for row in PLANNERS) + foot
        for file, language, head, foot in parts
    }


if __name__ == "__main__":
    for file, text in pages().items():
        file.write_text(text, encoding="utf-8")
