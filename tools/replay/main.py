"""`gemelo replay FILE SERVICE`: what a service has heard through its core again, and what it says beside what it said.

Exit code 0 only if every message is the same to the byte, 1 at the first difference, 2 where FILE cannot be replayed.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from gemelo.libraries.recordings.origin import PACKAGES, processor, version_of
from gemelo.libraries.recordings.reader import BadRecording
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.topics import Topic
from gemelo.tools.replay import planner, state_publisher, stepper_gateway
from gemelo.tools.replay.comparison import Comparison, Difference
from gemelo.tools.replay.options import add_options
from gemelo.tools.replay.recorded import NotReplayable, Recorded

CANNOT = 2  # the exit code of a recording that cannot be replayed


class ReplayableService(NamedTuple):
    """One service that can be replayed."""

    topics: Iterable[Topic[Any]]
    replay: Callable[[Recorded, Comparison], None]


SERVICES = {
    "planner": ReplayableService(planner.TOPICS, planner.replay),
    "stepper_gateway": ReplayableService(stepper_gateway.TOPICS_REPLAYED, stepper_gateway.replay),
    "state_publisher": ReplayableService(state_publisher.TOPICS, state_publisher.replay),
}


class Replayed(msgspec.Struct, frozen=True, kw_only=True):
    """One replay."""

    file: str
    service: str
    recorded_s: float  # [s] from the first message of the recording to the last
    replayed_s: float  # [s] that the replay took, without reading the file
    tolerance: float = 0.0  # share by which a float may differ
    alike: dict[str, int]  # messages that are the same, by topic
    aside: dict[str, int]  # messages that are not compared, by why
    added: dict[str, list[str]] = {}  # fields that a topic did not have when it was recorded: read with their defaults
    difference: Difference | None = None
    other_versions: dict[str, tuple[str, str]] = {}  # recorded and here, where they differ

    @property
    def speed(self) -> float:
        """Ratio to real time."""
        return self.recorded_s / self.replayed_s


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="gemelo replay", description="a recording as a test of one service")
    add_options(parser)
    options = parser.parse_args()
    try:
        replayed = replay(options.file, options.service, options.robot, options.tolerance)
    except (NotReplayable, BadRecording, ConfigurationError) as error:
        print(f"gemelo replay: {error}", file=sys.stderr)
        sys.exit(CANNOT)
    print(msgspec.json.encode(replayed).decode() if options.json else text_of(replayed))
    sys.exit(0 if replayed.difference is None else 1)


def replay(file: Path, service: str, robot: Path | None = None, tolerance: float = 0.0) -> Replayed:
    """Replays one service; floats may differ by the share `tolerance`.

    Raises `NotReplayable`, `BadRecording`, `ConfigurationError`.
    """
    chosen = SERVICES[service]
    recorded = Recorded(file, tuple(chosen.topics), robot)
    comparison = Comparison(tolerance)
    began = time.perf_counter()
    chosen.replay(recorded, comparison)
    took = time.perf_counter() - began
    if not comparison.alike and comparison.difference is None:
        raise NotReplayable(f"{file}: nothing in it can be compared: {_counted(comparison.aside) or 'it is empty'}")
    return Replayed(
        file=str(file), service=service, recorded_s=recorded.seconds, replayed_s=took,
        alike=dict(comparison.alike), aside={why: count for why, count in comparison.aside.items() if count},
        added={key: sorted(names) for key, names in recorded.added.items()}, tolerance=tolerance,
        difference=comparison.difference, other_versions=other_versions(recorded.versions),
    )  # fmt: skip


def other_versions(recorded: dict[str, str]) -> dict[str, tuple[str, str]]:
    """What decides how a core's numbers are rounded, where the recording was made with another than here."""
    here = {name: version_of(package) for name, package in PACKAGES.items() if name != "gemelo"}
    here |= {"python": platform.python_version(), "processor": processor()}
    return {name: (recorded[name], now) for name, now in here.items() if name in recorded and recorded[name] != now}


def text_of(replayed: Replayed) -> str:
    """The result for a person."""
    lines = [
        f"{replayed.service}, {replayed.file}: {replayed.recorded_s:.1f} s of recording in {replayed.replayed_s:.2f} s "
        f"({replayed.speed:.0f} times real time)"
    ]
    same = f"the same within {replayed.tolerance:g}" if replayed.tolerance else "the same to the byte"
    lines += [f"  {count:6} of {topic}: {same}" for topic, count in sorted(replayed.alike.items())]
    lines += [f"  {count:6} set aside: {why}" for why, count in sorted(replayed.aside.items())]
    lines += [
        f"  {topic} is older than its fields {', '.join(names)}: read with their defaults"
        for topic, names in sorted(replayed.added.items())
    ]
    return "\n".join([*lines, *_difference(replayed)])


def _difference(replayed: Replayed) -> list[str]:
    found = replayed.difference
    if found is None:
        return ["no difference"]
    others = [f"{name} {was}, here {now}" for name, (was, now) in replayed.other_versions.items()]
    return [
        f"DIFFERENT: {found.topic}, message {found.sequence}, {found.at:.3f} s into the recording",
        f"  field     {found.path or '(the whole message)'}",
        f"  recorded  {found.recorded}",
        f"  replayed  {found.replayed}",
        *([f"recorded with {'; '.join(others)}: which may round otherwise (--tolerance 1e-9)"] if others else []),
    ]


def _counted(counts: dict[str, int]) -> str:
    return "; ".join(f"{count} {why}" for why, count in counts.items() if count)
