"""`gemelo collision fit`: the spheres that cover each link for the compiled check, and how far they bulge."""

from __future__ import annotations

import sys
from argparse import ArgumentParser
from pathlib import Path

from schemas.errors import ConfigurationError
from services.arm.description import load_arm
from services.planner.covers.link_spheres import cover_shapes, link_shapes
from services.planner.covers.spheres import BULGE


def report(folder: Path, bulge: float = BULGE) -> str:
    """A line for every link with collision shapes, and their sum; `bulge` [m] is what is allowed."""
    rows = [("link", "shapes", "spheres", "bulge [mm]")]
    total = 0
    for link, shapes in link_shapes(load_arm(folder)).items():
        cover = cover_shapes(shapes, bulge)
        total += len(cover.spheres)
        rows.append((link, str(len(shapes)), str(len(cover.spheres)), f"{1000.0 * cover.bulge:.2f}"))
    rows.append(("all", "", str(total), ""))
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *(row[k].rjust(widths[k]) for k in (1, 2, 3))]).rstrip() for row in rows
    )


def main(arguments: list[str] | None = None) -> int:
    """0, or 1 with what is wrong on stderr."""
    parser = ArgumentParser(prog="gemelo collision fit")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bulge", type=float, default=1000.0 * BULGE)
    options = parser.parse_args(arguments)
    try:
        print(report(options.folder, options.bulge / 1000.0))
    except (ConfigurationError, ValueError, ImportError) as error:
        print(f"gemelo: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
