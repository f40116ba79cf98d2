"""`gemelo chaos`: faults in the middle of moves, on a stack of its own with the virtual device.

Leaves out/chaos/report.json and report.html beside the recordings and logs. Exit code 0 only if every invariant held:
no jump, no success that was none, nothing that moves by itself, no record lost, everything ready again in time.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random, randrange

import msgspec
from mcap.exceptions import EndOfFile, McapError
from mcap.stream_reader import StreamReader

from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.process.ending import ended_by_signals
from gemelo.schemas.deployment import DeviceKind
from gemelo.schemas.topics import JOINT_STATES
from gemelo.tools.chaos.campaign import Campaign, Episode, order
from gemelo.tools.chaos.faults import FAULTS, Fault
from gemelo.tools.chaos.invariants import missing_records
from gemelo.tools.chaos.report import ChaosReport, page_of, text_of
from gemelo.tools.chaos.site import ChaosSite, installed_broker, processes_of
from gemelo.tools.cli.recording.chaos import add_chaos_options
from gemelo.tools.stack.results import new_results
from gemelo.tools.stack.stack import StackError

Order = Iterator[tuple[int, Fault, Random]]  # number, fault and chance of each episode
LAST_WORDS = 2.0  # [s] at the end of a run of which records may still be on their way


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="gemelo chaos", description="faults in the middle of moves, judged")
    add_chaos_options(parser)
    options = parser.parse_args()
    if options.list:
        print("\n".join(f"{fault.name:<28} {fault.about}" for fault in FAULTS))
        return
    faults = possible_faults(chosen_faults(options.only), processes_of(load_deployment()))
    if reason := unfit(options.minutes, faults, options.only):
        sys.exit(f"chaos: {reason}")
    seed = randrange(1_000_000) if options.seed is None else options.seed
    wanted = order(seed, faults)
    if options.episode is not None:
        wanted = itertools.islice(wanted, options.episode, options.episode + 1)
    broker = options.broker or installed_broker()
    try:
        with ended_by_signals():
            is_good = run(wanted, seed, options.minutes * 60.0, broker, options.out.resolve(), tuple(options.only))
            sys.exit(0 if is_good else 1)
    except StackError as error:
        sys.exit(f"chaos: {error}")
    except KeyboardInterrupt:
        sys.exit("chaos: interrupted: its stack has been stopped, and there is no report")


def chosen_faults(words: Sequence[str]) -> tuple[Fault, ...]:
    """The faults whose names contain one of `words`; all where there are none."""
    return tuple(fault for fault in FAULTS if not words or any(word in fault.name for word in words))


def possible_faults(faults: Sequence[Fault], processes: Sequence[str]) -> tuple[Fault, ...]:
    """Those of `faults` that are done to none of the processes that do not run."""
    return tuple(fault for fault in faults if not fault.of or fault.of in processes)


def unfit(minutes: float, faults: Sequence[Fault], words: Sequence[str]) -> str:
    """Why chaos cannot run for `minutes` [min] as it was asked for, or ""."""
    if not 0.0 < minutes < float("inf"):
        return f"--minutes {minutes}: it must be above 0"
    if not faults:
        return f"no fault is called {' or '.join(words)}: see gemelo chaos --list"
    if load_deployment().device is DeviceKind.BOARD:
        return 'this deployment drives a real board (device = "board"): chaos is for virtual devices only'
    return ""


def run(
    wanted: Iterator[tuple[int, Fault, Random]],
    seed: int,
    seconds: float,
    broker: str,
    out: Path,
    only: tuple[str, ...],
) -> bool:
    """Runs episodes for `seconds` [s], or until there are no more, on a stack that is ready; writes and prints the
    report; True if all is good."""
    new_results(out)
    episodes: list[Episode] = []
    with ChaosSite(out, broker, seed) as site:
        say(f"seed {seed}, all ready after {site.stack.ready_seconds:.1f} s")
        campaign, begun = Campaign(site, say), time.monotonic()
        while time.monotonic() < begun + seconds and (next_one := next(wanted, None)) is not None:
            episode = campaign.episode(*next_one)
            episodes.append(episode)
            say(line_of(episode))
        took = time.monotonic() - begun
        robot, logs = site.arm.name, {name: site.stack.logs(name) for name in site.stack.processes}
        last = time.time_ns() - int(LAST_WORDS * 1e9)
    heard = [stamp for stamp in campaign.person.stamps if stamp < last]
    stamps, found = recorded(out)
    missing = missing_records(heard, stamps, campaign.muted)
    found += [f"{len(missing)} joint states are not recorded, the first at {missing[0]}"] if missing else []
    found += [f"{name} has raised an error: see {out / 'logs' / name}.log" for name, text in logs.items()
              if "Traceback" in text]  # fmt: skip
    report = ChaosReport(
        seed=seed, robot=robot, broker=broker, seconds=took, episodes=tuple(episodes),
        only=only, states_heard=len(heard), states_lost=len(missing), violations=tuple(found),
    )  # fmt: skip
    (out / "report.json").write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    (out / "report.html").write_text(page_of(report))
    print(f"\n{text_of(report)}\n\nreport: {out / 'report.html'}")
    return report.is_good


def line_of(episode: Episode) -> str:
    """One line about an episode that has just ended."""
    violated = f"; VIOLATED: {'; '.join(episode.violations)}" if episode.violations else ""
    hands = f"; by hand: {', '.join(episode.hands)}" if episode.hands else ""
    hands += "; the machine was late" if episode.was_late else ""
    return f"{episode.number:>4} {episode.chosen or episode.fault}: {episode.ended}{hands}{violated}"


def recorded(out: Path) -> tuple[set[int], list[str]]:
    """Stamps [ns] of all joint states in the recordings below `out`, and a sentence for each that cannot be read."""
    stamps: set[int] = set()
    found: list[str] = []
    files = sorted(out.rglob("*.mcap"))
    for path in files:
        try:
            for stamp in _joint_states(path):
                stamps.add(stamp)
        except EndOfFile:
            pass  # the chunk that was open when the logger was killed
        except McapError as error:
            found.append(f"{path.name} cannot be read: {error}")
    return stamps, found if files else [f"there is no recording in {out}"]


def _joint_states(path: Path) -> Iterator[int]:
    """Stamps [ns] of a file, up to a chunk that was cut off."""
    channels: set[int] = set()
    with path.open("rb") as file:
        for record in StreamReader(file).records:
            if getattr(record, "topic", "") == JOINT_STATES.key:
                channels.add(record.id)
            elif getattr(record, "channel_id", None) in channels and hasattr(record, "publish_time"):
                yield record.publish_time


def say(text: str) -> None:
    print(f"chaos: {text}", flush=True)


if __name__ == "__main__":
    main()
