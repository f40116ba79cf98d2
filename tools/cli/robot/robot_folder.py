"""`gemelo check` and `gemelo collision`: a robot's folder, its collision shapes and its allowed pairs of links."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.text_file import read_text
from gemelo.tools.cli.common.errors import CommandError, ExitCode, require_folder, usage
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import positive_length
from gemelo.tools.cli.parser import Options, Parser, positive_integer
from gemelo.tools.cli.robot.import_robot import add_xacro

if TYPE_CHECKING:
    from gemelo.libraries.arm.checks.findings import Finding
    from gemelo.libraries.arm.kinematics.collision_matrix import LinkPairData

FIT = "gemelo.tools.collision_fitting.main"  # in a process of its own: the command line loads no planner
BULGE = 0.005  # [m] that a sphere may reach beyond its link
MOST = 40  # shapes of a link
FIT_EXAMPLES = """examples:
  gemelo collision fit urdf/parol6
  gemelo collision fit urdf/my_arm --meshes
  gemelo collision fit urdf/my_arm --meshes --within 3mm --link forearm --most 40 --write"""


def folder_option(parser: Parser) -> None:
    """Adds the folder."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a robot's folder, as urdf/rm1")


def check_option(parser: Parser) -> None:
    """Adds the folder or URDF."""
    parser.add_argument("folder", type=Path, metavar="FOLDER_OR_URDF", help="a robot's folder, an export's, or a URDF")
    add_xacro(parser)


def run_check(options: Options) -> ExitCode:
    """Checks a robot's folder, or what `gemelo import` would read."""
    return print_findings(options.folder, dict(options.xacro))


def print_findings(folder: Path, xacro: Mapping[str, str]) -> ExitCode:
    """Prints every finding; FAILED if one of them is an error."""
    from gemelo.libraries.arm.checks.check import Severity  # slow to load: numpy and trimesh

    findings = _findings(folder, xacro)
    for finding in findings:
        print(sentence(finding.reason))
    errors, warnings = (sum(each.severity is kind for each in findings) for kind in (Severity.ERROR, Severity.WARNING))
    found = because("finding.count", folder=str(folder), errors=errors, warnings=warnings)
    print(sentence(found if errors or warnings else because("finding.none", folder=str(folder))))
    return ExitCode.FAILED if errors else ExitCode.OK


def _findings(folder: Path, xacro: Mapping[str, str]) -> list[Finding]:
    """Of a robot's folder; of a source for `gemelo import` where there is no robot.toml."""
    from gemelo.libraries.arm.checks.check import Severity  # slow to load: numpy and trimesh
    from gemelo.libraries.arm.checks.check import check as findings_in
    from gemelo.libraries.arm.model.description import ROBOT_FILE

    if (folder / ROBOT_FILE).is_file():
        from gemelo.libraries.robot_import.trial import trial_findings

        findings = findings_in(folder)
        is_broken = any(finding.severity is Severity.ERROR for finding in findings)
        return findings if is_broken else [*findings, *trial_findings(folder)]
    from gemelo.libraries.arm.errors import DescriptionError
    from gemelo.libraries.robot_import.importing import ImportOptions, source_findings

    print(sentence(because("finding.as_import", folder=str(folder), file=ROBOT_FILE)))
    try:
        return source_findings(ImportOptions(folder, Path(), yes=True, xacro=xacro, say=sentence))
    except DescriptionError as error:
        raise CommandError(error) from error


def fit_options(parser: Parser) -> None:
    """Adds folder, bulge and what --meshes takes."""
    parser.epilog = FIT_EXAMPLES
    folder_option(parser)
    parser.add_argument(
        "--bulge", type=positive_length, default=BULGE, metavar="DISTANCE", help="of a sphere beyond its link, as 5mm"
    )
    parser.add_argument("--meshes", action="store_true", help="fit boxes, cylinders, plates, capsules and balls")
    parser.add_argument(
        "--within",
        type=positive_length,
        default=None,
        metavar="DISTANCE",
        help="of the mesh, where 95 %% of the shapes' surface is to be, with --meshes [5mm, 1 %% of a longer link]",
    )
    parser.add_argument(
        "--most", type=positive_integer, default=MOST, metavar="N", help="shapes for a link, with --meshes"
    )
    parser.add_argument("--link", nargs="+", default=[], metavar="LINK", help="fit to these alone; the others stay")
    parser.add_argument("--write", action="store_true", help="replace the links' <collision> elements; the rest stays")


def run_fit(options: Options) -> ExitCode:
    """Fits spheres or shapes."""
    if options.meshes:
        return shapes(options.folder, options.within, options.most, options.link, options.write)
    if options.write or options.link:
        raise usage(because("cli.fit.meshes"))
    return spheres(options.folder, options.bulge)


def matrix_options(parser: Parser) -> None:
    """Adds folder, --always-within and --write."""
    folder_option(parser)
    parser.add_argument(
        "--always-within", type=positive_length, default=None, metavar="LENGTH",
        help="links that are never farther apart are excused [the robot's clearance]; more where shapes are coarse",
    )  # fmt: skip
    parser.add_argument("--write", action="store_true", help="change the SRDF; its comments stay")


def run_matrix(options: Options) -> ExitCode:
    """Prints and writes the pairs."""
    return print_matrix(options.folder, options.write, options.always_within)


def spheres(folder: Path, bulge: float) -> ExitCode:
    """Prints a line for each link; `bulge` [m] is how far a sphere may reach beyond it."""
    return _fitted(folder, "--bulge", f"{1000.0 * bulge:g}")


def shapes(folder: Path, within: float | None, most: int, links: Sequence[str], write: bool) -> ExitCode:
    """Prints the shapes that fit the links' meshes to within so many [m] or what is usual, at most `most` for each;
    writes them into the URDF if `write`."""
    only = [f"--link={link}" for link in links]
    bound = [] if within is None else [f"--within={1000.0 * within:g}"]
    return _fitted(folder, "--meshes", *bound, f"--most={most}", *only, *(["--write"] if write else []))


def _fitted(folder: Path, *options: str) -> ExitCode:
    require_folder(folder, str(folder))
    ended = subprocess.run([sys.executable, "-m", FIT, *options, "--", str(folder)], check=False)
    return ExitCode.OK if ended.returncode == 0 else ExitCode.FAILED


def print_matrix(folder: Path, write: bool, always_within: float | None) -> ExitCode:
    """Prints the pairs that sampling finds and the changes of the SRDF; changes it if `write`. `always_within` [m]."""
    from gemelo.libraries.arm.kinematics.collision_matrix import collision_matrix  # slow to load: coal
    from gemelo.libraries.arm.model.description import load_arm

    require_folder(folder, str(folder))
    from gemelo.libraries.arm.model.srdf_edit import with_pairs

    try:
        arm = load_arm(folder)
        text = read_text(arm.srdf_path)
    except (ValueError, OSError) as error:
        raise usage(error) from error
    verdicts = collision_matrix(arm, tell=_say, always_within=always_within)
    wanted, lines = plan_of(text, verdicts)
    print(listing(verdicts))
    for each in (verdict for verdict in verdicts if verdict.is_doubtful):
        print(sentence(because("cli.matrix.warning", doubt_of(each), file=arm.srdf_path.name)))
    changed = with_pairs(text, wanted)
    print("\n".join(lines) if lines else sentence(because("cli.matrix.same", file=str(arm.srdf_path))))
    if lines and write:
        _write(arm.srdf_path, changed)
    elif lines:
        print(sentence(because("cli.matrix.not_written")))
    return ExitCode.OK


def _say(progress: Reason) -> None:
    print(sentence(progress), file=sys.stderr, flush=True)


def plan_of(text: str, verdicts: list[LinkPairData]) -> tuple[dict[tuple[str, str], str], list[str]]:
    """The pairs that the SRDF is to have with their reasons, and each change as a line; a person's reasons stay."""
    from gemelo.libraries.arm.kinematics.collision_matrix import DisabledReason  # slow to load: coal
    from gemelo.libraries.arm.model.srdf_edit import entries

    present = {entry.pair: entry.reason for entry in entries(text)}
    ours = {str(reason) for reason in DisabledReason}
    found = {frozenset(verdict.pair): verdict for verdict in verdicts}
    wanted: dict[tuple[str, str], str] = {}
    lines = []
    for pair, reason in present.items():
        if reason not in ours:
            first, *rest = sorted(pair)
            wanted[(first, rest[0] if rest else first)] = reason
        elif pair not in found or found[pair].reason is None:
            first, second = sorted(pair)
            why = _why(found.get(pair))
            lines.append(sentence(because("cli.matrix.remove", why, first=first, second=second, reason=reason)))
    for pair, verdict in found.items():
        if verdict.reason is not None and present.get(pair, "") in (*ours, ""):
            wanted[verdict.pair] = verdict.reason
            if present.get(pair) != verdict.reason:
                first, second = verdict.pair
                added = {"first": first, "second": second, "reason": str(verdict.reason)}
                was = present.get(pair)
                change = because("cli.matrix.add", **added) if was is None else because(
                    "cli.matrix.change", was=was, **added
                )  # fmt: skip
                lines.append(sentence(change))
    return wanted, lines


def doubt_of(verdict: LinkPairData) -> Reason:
    """Why a pair that is always near is checked all the same, and what would do."""
    first, second = verdict.pair
    near, far = 1000.0 * verdict.nearest, 1000.0 * verdict.farthest
    return because("cli.matrix.doubt", first=first, second=second, near=near, far=far)


def _why(verdict: LinkPairData | None) -> Reason:
    if verdict is None:
        return because("cli.matrix.no_shape")
    return because("cli.matrix.near", near=1000.0 * verdict.nearest)


def listing(verdicts: list[LinkPairData]) -> str:
    """A table of all pairs, distances in [mm]."""
    rows = [
        (
            *verdict.pair,
            verdict.reason or word("matrix", "checked"),
            *(f"{1000.0 * d:.1f}" for d in (verdict.nearest, verdict.farthest)),
        )
        for verdict in verdicts
    ]
    return table(columns("link", "and link", "is", "nearest [mm]", "farthest [mm]"), rows)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CommandError(because("cli.file.unwritable", file=str(path), error=str(error.strerror))) from error
    print(sentence(because("cli.matrix.changed", file=str(path), folder=str(path.parent))))
