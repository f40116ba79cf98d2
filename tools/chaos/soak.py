"""`gemelo soak`: moves for hours on a stack of its own, and whether any process grows meanwhile.

Leaves out/soak/report.json. Exit code 0 only if every move succeeded and, after the warm-up, no process's memory grew
by more than 1 MB an hour, nor its number of files, sockets and threads by more than a few. Memory is what belongs to
no file (`Anonymous` of proc(5)'s smaps_rollup): pages of libraries come and go with the kernel's cache, and are
shared. Where the system does not tell it, it is the resident memory.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from random import Random

import msgspec
import numpy as np
import psutil

import gemelo
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.endpoints import parameter_request
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.libraries.runtime.process.ending import ended_by_signals
from gemelo.schemas.deployment import DeviceKind
from gemelo.schemas.reasons import Reason, Value, because
from gemelo.schemas.system import SetParameter
from gemelo.tools.chaos.causes import cause_of
from gemelo.tools.chaos.site import ChaosSite, installed_broker
from gemelo.tools.cli.common.language import choose, columns, sentence
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.recording.chaos import add_soak_options, language_option
from gemelo.tools.stack.results import new_results
from gemelo.tools.stack.stack import StackError

EVERY = 5.0  # [s] between two samples
TOLD_EVERY = 300.0  # [s] between two lines about how far it is
WARM_UP = 0.4  # of the time: caches fill, allocators settle; measured: of an hour 22 minutes, in stepper_gateway
FILES = 10  # of a recording, in a soak
TO_SET = 5.0  # [s] for the logger to take a parameter
STEEPEST = 1.0  # [MB/h] of memory
FEW = 4  # files, sockets or threads that come and go
TO_END = 10.0  # [s] beyond a move's own time
FEWEST = 20  # samples after the warm-up below which a slope says nothing
HOUR, MB = 3600.0, 1e6
COLUMNS = ("process", "CPU [%]", "memory [MB]", "[MB/h]", "files", "sockets", "threads")


class ProcessSample(msgspec.Struct, frozen=True):
    """One process with its children at one time."""

    at: float  # [s] since the beginning
    memory: float  # [MB] of no file
    resident: float  # [MB] with the pages of files
    cpu: float  # [s] since the process began
    files: int
    sockets: int
    threads: int


class Growth(msgspec.Struct, frozen=True, kw_only=True):
    """How a process has grown after the warm-up."""

    process: str
    cpu_percent: float  # of a core
    memory: float  # [MB] at the end
    memory_slope: float  # [MB/h] by least squares
    files: int  # more at the end than after the warm-up
    sockets: int
    threads: int


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="gemelo soak", description="moves for hours; does anything grow?")
    add_soak_options(parser)
    language_option(parser)
    options = parser.parse_args()
    choose(options.lang)
    if not 0.0 < options.hours < float("inf"):
        sys.exit(f"soak: {sentence(because('soak.hours', hours=options.hours))}")
    if load_deployment().device is DeviceKind.BOARD:
        sys.exit(f"soak: {sentence(because('soak.board'))}")
    broker = options.broker or installed_broker()
    try:
        with ended_by_signals():
            sys.exit(0 if run(options.hours * HOUR, options.seed, broker, options.out.resolve()) else 1)
    except (StackError, NoAnswer) as error:
        sys.exit(f"soak: {sentence(error.reason)}")
    except KeyboardInterrupt:
        sys.exit(f"soak: {sentence(because('soak.interrupted'))}")


def run(seconds: float, seed: int, broker: str, out: Path) -> bool:
    """Moves for `seconds` [s]; writes and prints the report; True if nothing grew and every move succeeded."""
    new_results(out)
    random, samples, failures, moves = Random(seed), dict[str, list[ProcessSample]](), list[Reason](), 0
    with ChaosSite(out, broker, seed, is_judged=False) as site:
        change_files_often(site.arm, seconds)
        person, begun = site.person, time.monotonic()
        due, told = begun, begun + TOLD_EVERY
        while (now := time.monotonic()) < begun + seconds:
            try:
                motion = person.start(random)
                motion.wait(motion.plan.duration + TO_END)
                moves += 1
            except (gemelo.Error, TimeoutError) as error:
                failures.append(cause_of(error))
                person.pause(1.0)
            if now >= due:
                due = now + EVERY
                for name, pid in site.stack.pids().items():
                    with suppress(psutil.Error):
                        samples.setdefault(name, []).append(sample_of(pid, now - begun))
            if now >= told:
                told = now + TOLD_EVERY
                print(sentence(progress(now - begun, seconds, moves, len(failures), samples)), flush=True)
    growths = [growth_of(name, kept) for name, kept in sorted(samples.items())]
    found = [why for growth in growths for why in complaints(growth, len(samples[growth.process]))] + failures
    violations = list(map(str, found))
    report = {"seconds": seconds, "moves": moves, "processes": growths, "violations": violations, "samples": samples}
    (out / "report.json").write_bytes(msgspec.json.encode(report) + b"\n")
    print(text_of(growths, moves, found))
    return not found


def change_files_often(arm: gemelo.Arm, seconds: float) -> None:
    """A soak of `seconds` [s] sees several files of a recording: the index of an open one is kept until it ends, some
    13 MB an hour, which is no growth."""
    request = parameter_request("logger")
    arm.node.call(request, SetParameter(name="max_age_minutes", value=seconds / 60.0 / FILES), timeout=TO_SET)


def progress(
    elapsed: float, seconds: float, moves: int, failed: int, samples: Mapping[str, Sequence[ProcessSample]]
) -> Reason:
    """One line of a soak that goes on; `elapsed` of `seconds` [s]."""
    memory = sum(of_one[-1].memory for of_one in samples.values())
    about: dict[str, Value] = {"moves": moves, "failed": failed, "memory": memory}
    return because("soak.progress", elapsed=elapsed / 60.0, total=seconds / 60.0, **about)


def sample_of(pid: int, at: float) -> ProcessSample:
    """The process `pid` and all that it has started, `at` [s]."""
    process = psutil.Process(pid)
    family = [process, *process.children(recursive=True)]
    times = [each.cpu_times() for each in family]
    return ProcessSample(
        at=at,
        memory=sum(map(anonymous, family)) / MB,
        resident=sum(each.memory_info().rss for each in family) / MB,
        cpu=sum(each.user + each.system for each in times),
        files=sum(each.num_fds() for each in family),
        sockets=sum(len(each.net_connections()) for each in family),
        threads=sum(each.num_threads() for each in family),
    )


def anonymous(process: psutil.Process) -> int:
    """[B] in memory of no file; all that is in memory where the system does not tell them apart."""
    with suppress(OSError), open(f"/proc/{process.pid}/smaps_rollup", encoding="ascii") as file:
        for line in file:
            if line.startswith("Anonymous:"):
                return 1024 * int(line.split()[1])
    resident: int = process.memory_info().rss
    return resident


def growth_of(name: str, samples: Sequence[ProcessSample]) -> Growth:
    """The slope of the memory by least squares and the differences of the rest, after the warm-up."""
    kept = samples[int(WARM_UP * len(samples)) :]
    first, last = kept[0], kept[-1]
    elapsed = max(last.at - first.at, 1e-9)
    slope = (
        float(np.polyfit([each.at for each in kept], [each.memory for each in kept], 1)[0]) if len(kept) > 1 else 0.0
    )
    return Growth(
        process=name,
        cpu_percent=100.0 * (last.cpu - first.cpu) / elapsed,
        memory=last.memory,
        memory_slope=slope * HOUR,
        files=last.files - first.files,
        sockets=last.sockets - first.sockets,
        threads=last.threads - first.threads,
    )


def complaints(growth: Growth, count: int) -> list[Reason]:
    """What of a process grew although it should not; nothing of a slope where there were few of `count` samples."""
    found = []
    if growth.memory_slope > STEEPEST and count * (1.0 - WARM_UP) >= FEWEST:
        found.append(because("soak.memory", process=growth.process, slope=growth.memory_slope, limit=STEEPEST))
    counts: Mapping[str, int] = {"files": growth.files, "sockets": growth.sockets, "threads": growth.threads}
    about = {what: more for what, more in counts.items() if more > FEW}
    return found + [because("soak.more", process=growth.process, more=more, what=what) for what, more in about.items()]


def text_of(growths: Sequence[Growth], moves: int, found: Sequence[Reason]) -> str:
    """A table, a line a process, and what was found."""
    rows = [
        (each.process, f"{each.cpu_percent:.1f}", f"{each.memory:.0f}", f"{each.memory_slope:+.2f}",
         f"{each.files:+d}", f"{each.sockets:+d}", f"{each.threads:+d}")
        for each in growths
    ]  # fmt: skip
    total = because("soak.total", moves=moves, complaints=len(found))
    return "\n".join([table(columns(*COLUMNS), rows), "", *map(sentence, (total, *found))])


if __name__ == "__main__":
    main()
