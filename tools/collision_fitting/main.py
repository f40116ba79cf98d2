"""`gemelo collision fit`: shapes for the links from their meshes, and the spheres that cover those for the native
planner."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.errors import ConfigurationError, ReasonedError
from gemelo.schemas.plain_text import of_environment
from gemelo.schemas.reasons import because
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes
from gemelo.services.planner.native.sphere_cover import BULGE, link_cover
from gemelo.tools.cli.common.language import choose, columns, sentence, word

if TYPE_CHECKING:
    from gemelo.tools.collision_fitting.mesh_fit import LinkFit


def report(folder: Path, bulge: float = BULGE) -> str:
    """A line for every link with collision shapes, and their sum; `bulge` [m] is allowed, more for large links."""
    rows = [columns("link", "shapes", "spheres", "bulge [mm]")]
    total = 0
    for link, shapes in link_shapes(load_arm(folder)).items():
        cover = link_cover(shapes, bulge)
        total += len(cover.spheres)
        rows.append((link, str(len(shapes)), str(len(cover.spheres)), f"{1000.0 * cover.bulge:.2f}"))
    return _table([*rows, (word("row", "all"), "", str(total), "")])


def fit_meshes(folder: Path, within: float | None, most: int, only: Sequence[str], write: bool) -> str:
    """What is fitted to each link, to within so many [m] or what is usual, and its elements for the URDF, or that they
    are written."""
    # Not above: trimesh takes half a second.
    from gemelo.tools.collision_fitting.fit_writing import elements_of, touching_states, write_fits
    from gemelo.tools.collision_fitting.mesh_fit import beyond_bound, fit_links

    arm = load_arm(folder)
    fits = fit_links(arm, within, most, only, lambda reason: print(sentence(reason), file=sys.stderr, flush=True))
    rows = [(*columns("link", "shapes", "95 % within [mm]", "worst [mm]", "at [mm]"), "")]
    for fit in fits:
        figures = str(len(fit.shapes)), f"{1000.0 * fit.excess.p95:.1f}", f"{1000.0 * fit.excess.worst:.1f}"
        place = " ".join(f"{1000.0 * value:.0f}" for value in fit.excess.place)
        rows.append((fit.link, *figures, place, _kinds(fit)))
    lines = [_table(rows)]
    for fit in fits:
        if not fit.is_within:
            print(sentence(because("fit.warning", beyond_bound(fit, most))), file=sys.stderr)
    if write:
        changed = write_fits(arm, fits)
        lines += [sentence(because("fit.touch.remedy", touching)) for touching in touching_states(changed)]
        lines.append(sentence(because("fit.written", file=str(arm.urdf_path))))
        return "\n".join([*lines, sentence(because("fit.see_pairs", folder=str(folder)))])
    for fit in fits:
        lines += [f"{fit.link}:", *elements_of(fit)]
    return "\n".join([*lines, sentence(because("fit.not_written"))])


def _kinds(fit: LinkFit) -> str:
    return ", ".join(
        f"{count} {word('fit', kind)}" for kind, count in Counter(shape.kind for shape in fit.shapes).items()
    )


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    """The first column and words at the end to the left, figures to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "\n".join(
        "  ".join(
            [
                row[0].ljust(widths[0]),
                *(row[k].rjust(widths[k]) for k in (1, 2, 3)),
                *(each.ljust(width) for each, width in zip(row[4:], widths[4:], strict=True)),
            ]
        ).rstrip()
        for row in rows
    )


def _options(arguments: list[str] | None) -> Namespace:
    parser = ArgumentParser(prog="gemelo collision fit")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bulge", type=float, default=1000.0 * BULGE)
    parser.add_argument("--meshes", action="store_true")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--within", type=float, default=None)
    parser.add_argument("--most", type=int, default=40)
    parser.add_argument("--link", action="append", default=[])
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """0, or 1 with what is wrong on stderr."""
    choose(of_environment(os.environ))
    options = _options(arguments)
    try:
        if options.meshes:
            within = None if options.within is None else options.within / 1000.0
            print(fit_meshes(options.folder, within, options.most, options.link, options.write))
        else:
            print(report(options.folder, options.bulge / 1000.0))
    except (ConfigurationError, ValueError, ImportError, OSError) as error:
        print(f"gemelo: {sentence(error.reason) if isinstance(error, ReasonedError) else error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
