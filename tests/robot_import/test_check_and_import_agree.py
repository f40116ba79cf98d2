"""`gemelo check` and `gemelo import` find the same in twenty generated descriptions as their owners have them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.plain_arm import APART, LIMIT, LINKS, arm, body, boxes, hinge, hinges, meshed
from tests.robot_import.test_owners_arm import sliding
from tests.robot_import.test_sizes_and_places import UNITS, assembled, in_unit
from tests.robot_import.test_what_restricts_motion import LIMITS, SAFETY, SRDF, jaws

Make = Callable[[Path, Random], Path]


def in_some_unit(folder: Path, random: Random) -> Path:
    return in_unit(folder, random.choice(list(UNITS)), APART * random.uniform(1.0, 1.2))


def with_srdf(folder: Path, random: Random) -> Path:
    source = arm(folder)
    (folder / "arm.srdf").write_text(SRDF.format(name=random.choice(["arm", "other"]), more=""))
    return source


def with_limits(folder: Path, random: Random) -> Path:
    source = arm(folder)
    (folder / "joint_limits.yaml").write_text(LIMITS.replace("0.25", f"{random.uniform(0.1, 2.0):.3f}"))
    return source


def beside(folder: Path, random: Random) -> Path:
    ball = '<geometry><sphere radius="0.03"/></geometry>'
    content = body("visual") + body("collision", ball, f"{random.uniform(0.4, 0.9):.3f} 0 0.1")
    return arm(folder, boxes(**{random.choice(LINKS): content}), hinges())


def missing(tag: str) -> Make:
    """One mesh is not there, which is to be seen or to be touched."""

    def make(folder: Path, random: Random) -> Path:
        both = {"visual": body("visual"), "collision": body("collision")} | {tag: meshed("gone.stl", tags=(tag,))}
        return arm(folder, boxes(**{random.choice(LINKS): "".join(both.values())}), hinges())

    return make


def in_two_units(folder: Path, random: Random) -> Path:
    return in_unit(folder, "cm", APART * random.uniform(0.66, 0.78))


def without_motion(folder: Path, random: Random) -> Path:
    return arm(folder, boxes(), *(hinge(f"j{n}", LINKS[n - 1], LINKS[n], "", kind="fixed") for n in (1, 2, 3)))


STOPPED_EARLY: dict[str, Make] = {  # by what the survey finds, before anything is built
    "two units fit": in_two_units,
    "no frame explains it": lambda folder, random: assembled(folder, random.uniform(0.5, 2.0)),
    "a collision shape beside": beside,
    "no collision mesh": missing("collision"),
    "a follower without travel": lambda folder, random: jaws(folder, 0.03, -random.uniform(0.5, 2.0)),
    "no joint that moves": without_motion,
}
BUILT: dict[str, Make] = {
    "it is always near, and can touch": lambda folder, random: sliding(folder, -random.uniform(0.01, 0.03), 0.0025),
    "a long name": lambda folder, random: arm(folder, boxes(), hinges(), name="arm_" * random.randint(8, 14)),
    "meshes in some unit": in_some_unit,
    "meshes in the assembly's frame": lambda folder, random: assembled(folder),
    "soft limits": lambda folder, random: arm(
        folder, boxes(), hinges(j3=LIMIT + SAFETY.format(-random.uniform(0.5, 3.0), random.uniform(0.5, 3.0)))
    ),
    "a follower": lambda folder, random: jaws(folder, random.uniform(0.01, 0.03)),
    "an SRDF": with_srdf,
    "MoveIt's limits": with_limits,
}
ALL = {**STOPPED_EARLY, **BUILT}
PARTS = 4  # of the tests that build robots: each takes a while


def findings(said: str, place: Path) -> list[str]:
    """The lines of findings, without the folder in them; plans that are tried within a time depend on the machine."""
    lines = [line for line in said.splitlines() if re.match(r"(error|warning|note|mended): ", line)]
    plain = [re.sub(r"^mended: ", "note: ", line).replace(str(place), "PLACE") for line in lines]
    return sorted(line for line in plain if ": plans, " not in line)


@pytest.mark.parametrize(
    "names",
    [
        [*STOPPED_EARLY, *STOPPED_EARLY, *list(BUILT)[:1]],
        *(pytest.param(list(BUILT)[part::PARTS], marks=pytest.mark.full) for part in range(PARTS)),
    ],
    ids=["refused", *(f"built {part}" for part in range(PARTS))],
)
def test_check_and_import_find_the_same(
    names: list[str], tmp_path: Path, subtests: pytest.Subtests, capsys: pytest.CaptureFixture[str]
):
    """And what import refuses leaves nothing behind."""
    for number, name in enumerate(names):
        with subtests.test(name):
            folder = tmp_path / f"robot{number}"
            source, output = ALL[name](folder, Random(number)), folder / "urdf"
            checked = run(["check", str(source)])
            said = capsys.readouterr().out
            imported = run(["import", str(source), "--yes", "--output", str(output)])
            found = findings(capsys.readouterr().out, output / "arm")
            assert found == findings(said.replace(str(source), str(output / "arm")), output / "arm")
            assert checked is imported
            assert (imported is ExitCode.FAILED) == any(each.startswith("error: ") for each in found)
            assert (name in STOPPED_EARLY) <= (imported is ExitCode.FAILED)
            assert output.exists() == (imported is ExitCode.OK)
            assert not list(folder.glob("**/.*partial"))
