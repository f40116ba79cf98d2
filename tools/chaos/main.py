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
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import JOINT_STATES
from gemelo.tools.chaos.campaign import Campaign, Episode, order
from gemelo.tools.chaos.faults import FAULTS, Fault
from gemelo.tools.chaos.invariants import missing_records
from gemelo.tools.chaos.report import ChaosReport, page_of, reasons_of, text_of
from gemelo.tools.chaos.site import ChaosSite, installed_broker, processes_of
from gemelo.tools.cli.common.language import choose, sentence, translated
from gemelo.tools.cli.recording.chaos import add_chaos_options, language_option
from gemelo.tools.stack.results import new_results
from gemelo.tools.stack.stack import StackError

Order = Iterator[tuple[int, Fault, Random]]  # number, fault and chance of each episode
LAST_WORDS = 2.0  # [s] at the end of a run of which records may still be on their way


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="gemelo chaos", description="faults in the middle of moves, judged")
    add_chaos_options(parser)
    language_option(parser)
    options = parser.parse_args()
    choose(options.lang)
    if options.list:
        print("\n".join(f"{fault.name:<28} {translated(fault.about)}" for fault in FAULTS))
        return
    faults = possible_faults(chosen_faults(options.only), processes_of(load_deployment()))
    if (reason := unfit(options.minutes, faults, options.only)) is not None:
        sys.exit(f"chaos: {sentence(reason)}")
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
        sys.exit(f"chaos: {sentence(error.reason)}")
    except KeyboardInterrupt:
        sys.exit(f"chaos: {sentence(because('chaos.interrupted'))}")


def chosen_faults(words: Sequence[str]) -> tuple[Fault, ...]:
    """The faults whose names contain one of `words`; all where there are none."""
    return tuple(fault for fault in FAULTS if not words or any(word in fault.name for word in words))


def possible_faults(faults: Sequence[Fault], processes: Sequence[str]) -> tuple[Fault, ...]:
    """Those of `faults` that are done to none of the processes that do not run."""
    return tuple(fault for fault in faults if not fault.of or fault.of in processes)


def unfit(minutes: float, faults: Sequence[Fault], words: Sequence[str]) -> Reason | None:
    """Why chaos cannot run for `minutes` [min] with these options; None where it can."""
    if not 0.0 < minutes < float("inf"):
        return because("chaos.minutes", minutes=minutes)
    if not faults:
        return because("chaos.no_fault", words=tuple(words))
    return because("chaos.board") if load_deployment().device is DeviceKind.BOARD else None


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
        say(sentence(because("chaos.ready", seed=seed, time=site.stack.ready_seconds)))
        campaign, begun = Campaign(site, say), time.monotonic()
        while time.monotonic() < begun + seconds and (next_one := next(wanted, None)) is not None:
            episode = campaign.episode(*next_one)
            episodes.append(episode)
            say(sentence(line_of(episode)))
        took = time.monotonic() - begun
        robot, logs = site.arm.name, {name: site.stack.logs(name) for name in site.stack.processes}
        last = time.time_ns() - int(LAST_WORDS * 1e9)
    heard = [stamp for stamp in campaign.person.stamps if stamp < last]
    stamps, found = recorded(out)
    missing = missing_records(heard, stamps, campaign.muted)
    found += [because("chaos.not_recorded", count=len(missing), first=missing[0])] if missing else []
    found += [because("chaos.raised", name=name, file=f"{out / 'logs' / name}.log") for name, text in logs.items()
              if "Traceback" in text]  # fmt: skip
    report = ChaosReport(
        seed=seed, robot=robot, broker=broker, seconds=took, episodes=tuple(episodes),
        only=only, states_heard=len(heard), states_lost=len(missing), violations=tuple(map(str, found)),
        why=tuple(found),
    )  # fmt: skip
    (out / "report.json").write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    (out / "report.html").write_text(page_of(report), encoding="utf-8")
    print(f"\n{text_of(report)}\n\n{sentence(because('chaos.report', file=str(out / 'report.html')))}")
    return report.is_good


def line_of(episode: Episode) -> Reason:
    """One line about an episode that has just ended."""
    notes = [because("chaos.by_hand", hands=episode.hands)] if episode.hands else []
    notes += [because("chaos.late")] if episode.was_late else []
    notes += [because("chaos.violated", *reasons_of(episode))] if episode.violations else []
    code = "chaos.ended.notes" if notes else "chaos.ended"
    return because(code, *notes, number=episode.number, fault=episode.chosen or episode.fault, ended=episode.ended)


def recorded(out: Path) -> tuple[set[int], list[Reason]]:
    """Stamps [ns] of all joint states in the recordings below `out`, and a reason for each that cannot be read."""
    stamps: set[int] = set()
    found: list[Reason] = []
    files = sorted(out.rglob("*.mcap"))
    for path in files:
        try:
            for stamp in _joint_states(path):
                stamps.add(stamp)
        except EndOfFile:
            pass  # the chunk that was open when the logger was killed
        except McapError as error:
            found.append(because("chaos.unreadable", file=path.name, error=str(error)))
    return stamps, found if files else [because("chaos.no_recording", folder=str(out))]


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
