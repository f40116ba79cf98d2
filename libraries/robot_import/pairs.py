"""The pairs of links of a new robot's folder that need no check, sampled in a process of its own.

`python -m gemelo.libraries.robot_import.pairs ROBOT_FOLDER METRES` prints each pair as JSON, one a line; links
that are never farther apart than METRES are always near.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import PAIR, DescriptionError, Subject
from gemelo.libraries.arm.kinematics.collision_matrix import LinkPairData, collision_matrix
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.srdf_edit import with_pairs
from gemelo.libraries.robot_import.mended import Mended, with_remedy
from gemelo.libraries.robot_import.questions import yes_or_no
from gemelo.libraries.robot_import.semantics import OF_SRDF
from gemelo.schemas.reasons import because, remedy

# Of the steps in processes of their own: with matrices of three columns the threads of BLAS cost a fourth more CPU.
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
MODULE = "gemelo.libraries.robot_import.pairs"
MOST_NAMED = 3  # pairs of an SRDF that can touch
BY_PERSON = "User"  # the reason of a pair that a person has excused


def sampled_pairs(folder: Path, within: float | None) -> list[LinkPairData]:
    """Of the robot in `folder`; links never farther apart than `within` [m], else its clearance, are always near.
    Raises `DescriptionError`."""
    metres = load_arm(folder).clearance if within is None else within
    command = [sys.executable, "-m", MODULE, str(folder), repr(metres)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env={**ONE_THREAD, **os.environ})
    if done.returncode:
        printed = done.stdout.strip()
        failed = because("import.pairs.failed", printed=printed) if printed else because("import.pairs.ended")
        raise DescriptionError(failed)
    return [msgspec.json.decode(line, type=LinkPairData) for line in done.stdout.splitlines()]


def write_pairs(arm: ArmDescription, pairs: Sequence[LinkPairData], mended: Mended) -> Iterator[Finding]:
    """Writes those that need no check into robot.srdf, with those that the owner's SRDF excuses and a person excuses;
    yields what can touch of them, and as errors what is asked where nobody is there."""
    file = arm.srdf_path.name
    wanted = {each.pair: str(each.reason) for each in pairs if each.reason is not None}
    given = mended.semantics.pairs if mended.semantics is not None else {}
    owners = {pair: f"{OF_SRDF}{reason or 'no reason'}" for pair, reason in given.items()}
    found = {tuple(sorted(each.pair)): each for each in pairs}
    touching = [found[pair] for pair in owners if pair in found and found[pair].reason is None]
    wanted |= {pair: reason for pair, reason in owners.items() if pair not in map(_sorted, wanted) and pair in found}
    for each in touching[:MOST_NAMED]:
        mend, more = remedy("not_checked_as_srdf"), len(touching) - MOST_NAMED
        what = because("mend.pair.excused", mend, distance=each.nearest)
        if more > 0:
            what = because("mend.pair.excused.more", mend, distance=each.nearest, more=more)
        yield warning(file, _subject(each), what)
    for each in pairs:
        if each.is_doubtful and _sorted(each.pair) not in owners:
            first, second = each.pair
            key = f"excuse.{first}.{second}"
            hinge = because("mend.pair.hinge", nearest=each.nearest, farthest=each.farthest)
            question = because("import.ask.excuse", _subject(each).around(hinge))
            said = mended.questions.ask_without_default(key, question, yes_or_no)
            if said is None:
                mend = remedy("excuse_by_answer", key=key)
                yield error(mended.source.label, _subject(each), with_remedy(hinge, mend))
            elif said:
                wanted[each.pair] = BY_PERSON
    text = arm.srdf_path.read_text(encoding="utf-8")
    arm.srdf_path.write_text(with_pairs(text, wanted), encoding="utf-8")


def _sorted(pair: tuple[str, str]) -> tuple[str, str]:
    first, second = sorted(pair)
    return first, second


def _subject(each: LinkPairData) -> Subject:
    return Subject(PAIR, *each.pair)


def main() -> int:
    """0, or 1 with what is wrong on stderr."""
    try:
        for each in collision_matrix(load_arm(Path(sys.argv[1])), always_within=float(sys.argv[2])):
            print(msgspec.json.encode(each).decode())
    except ValueError as problem:
        print(f"gemelo: {problem}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
