"""`gemelo link bench`: the round trip to the device over its own wire, as the old systems measured theirs."""

from __future__ import annotations

import csv
import math
import statistics
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import msgspec

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.device import EchoRequest, EchoResponse
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.topics import DEVICE_ECHO, JOINT_STATES, JOINT_TARGETS
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import parse_joints
from gemelo.tools.cli.parser import Options, Parser, positive_integer, positive_number

PATIENCE = 2.0  # [s] for one answer, the bus included
SWING = 4.0  # [s] of one turn of --move
SHOWN = 0.5  # [ms] of waiting; chosen: a board of ours thinks for less
SIZE, EDGE = (720, 240), 40  # of the plot


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """What was measured; times in [ms]."""

    rate: float  # [Hz] asked for
    reached: float  # [Hz]
    count: int
    lost: int
    median: float | None = None
    mean: float | None = None
    p99: float | None = None
    jitter: float | None = None  # mean difference of neighbours, as RFC 3550 means it
    largest: float | None = None
    waiting: float | None = None  # median, that a question waited for the board's next line; it is in no other figure


class Measured(NamedTuple):
    """What the questions of one run brought."""

    trips: list[float | None]  # [s] of each; None: it was lost
    waits: list[float]  # [s] that each which was answered waited at the device
    took: float  # [s] altogether


def add_options(parser: Parser) -> None:
    """Adds rate, count, --move, --out and --json."""
    parser.add_argument("--rate", type=positive_number, default=25.0, metavar="HZ", help="questions a second [25]")
    parser.add_argument("--count", type=positive_integer, default=45_000, metavar="N", help="of them [45000: 30 min]")
    parser.add_argument("--move", metavar="JOINT=AMOUNT", help="swing a joint by so much meanwhile; else nothing moves")
    parser.add_argument("--out", type=Path, default=None, metavar="FOLDER", help="for link_bench.csv and .svg [out]")
    parser.add_argument("--json", action="store_true", help="JSON, times in ms")


def run(options: Options) -> ExitCode:
    """Measures, prints the table, writes CSV and plot."""
    if options.rate > 200.0:
        raise usage(because("link.bench.rate"))
    with connect() as session:
        swing = swinging(session, options.move) if options.move else lambda _elapsed: None
        measured = measure(session, options.rate, options.count, swing)
    trips, result = measured.trips, result_of(measured, options.rate)
    folder = options.out or project_root() / session.deployment.paths.out
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "link_bench.csv", trips, options.rate)
    (folder / "link_bench.svg").write_text(plot(trips), encoding="utf-8")
    print(msgspec.json.encode(result).decode() if options.json else text_of(result, folder))
    return ExitCode.OK if result.lost == 0 else ExitCode.FAILED


def measure(session: CommandSession, rate: float, count: int, swing: Callable[[float], None]) -> Measured:
    """The round trips of `count` questions at `rate` [1/s]; Ctrl-C ends it early."""
    node, trips, waits = session.node, list[float | None](), list[float]()
    began = node.monotonic()
    try:
        for index in range(count):
            node.wait(max(0.0, began + index / rate - node.monotonic()))
            swing(node.monotonic() - began)
            answer = session.node.call(DEVICE_ECHO, EchoRequest(), timeout=PATIENCE)
            trips.append(_trip(answer, is_first=index == 0))
            waits += [answer.waiting] if answer.answered else []
    except KeyboardInterrupt:
        if not trips:
            raise
    return Measured(trips, waits, node.monotonic() - began)


def _trip(answer: EchoResponse, is_first: bool) -> float | None:
    is_lost = answer.why is not None and answer.why.code == "echo.unanswered"
    if is_first and not answer.answered and not is_lost:
        raise CommandError(answer.why or plain(answer.reason))
    return answer.round_trip if answer.answered else None


def swinging(session: CommandSession, assignment: str) -> Callable[[float], None]:
    """Streams a sine about where the joint is, at each time [s]; raises `CommandError` where it is none."""
    ((name, amount),) = parse_joints([assignment], session.arm.joints).items()
    states, targets = session.node.latest(JOINT_STATES), session.node.publisher(JOINT_TARGETS)
    deadline = session.node.monotonic() + PATIENCE
    while states.message is None and session.node.monotonic() < deadline:
        session.node.wait(0.02)
    if states.message is None:
        raise CommandError(because("status.silent.arm", time=PATIENCE), ExitCode.NO_STACK)
    start = dict(zip(states.message.name, states.message.position, strict=True))[name]

    def swing(elapsed: float) -> None:
        position = start + amount * math.sin(math.tau * elapsed / SWING)
        targets.put(JointTargets(name=(name,), position=(position,)))

    return swing


def result_of(measured: Measured, rate: float) -> Result:
    """The figures of a run at `rate` [1/s]."""
    trips, waits, took = measured
    found = [1e3 * trip for trip in trips if trip is not None]
    base = Result(rate=rate, reached=len(trips) / took if took else 0.0, count=len(trips), lost=len(trips) - len(found))
    if not found:
        return base
    ordered = sorted(found)
    steps = [abs(b - a) for a, b in pairwise(found)]
    return msgspec.structs.replace(
        base,
        median=statistics.median(found),
        mean=statistics.fmean(found),
        p99=ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))],
        jitter=statistics.fmean(steps) if steps else 0.0,
        largest=ordered[-1],
        waiting=1e3 * statistics.median(waits) if waits else None,
    )


def text_of(result: Result, folder: Path) -> str:
    """The table, with what the old system published beside it."""
    reached = because("link.bench.reached", reached=result.reached, rate=result.rate)
    lost = because("link.bench.lost", lost=result.lost, count=result.count)
    rows = [(word("bench", "rate"), sentence(reached)), (word("bench", "lost"), sentence(lost))]
    for name in ("median", "mean", "p99", "jitter", "largest"):
        value = getattr(result, name)
        rows.append((word("bench", name), "-" if value is None else f"{value:.3f} ms"))
    if result.waiting is not None and result.waiting >= SHOWN:
        rows.append((word("bench", "waiting"), sentence(because("link.bench.waiting", time=result.waiting))))
    said = table(columns("round trip", "measured"), rows)
    return f"{said}\n\n{sentence(because('link.bench.published'))}\n{folder}/link_bench.csv, link_bench.svg"


def write_csv(path: Path, trips: Sequence[float | None], rate: float) -> None:
    """One row per question, of `rate` [1/s]; the round trip [s] is empty where it was lost."""
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(("number", "asked_s", "round_trip_ms"))
        for index, trip in enumerate(trips):
            rows.writerow((index, f"{index / rate:.3f}", "" if trip is None else f"{1e3 * trip:.4f}"))


def plot(trips: Sequence[float | None]) -> str:
    """The round trips [s] over their numbers, as SVG; lost ones are red at the top."""
    width, height = SIZE
    top = max((1e3 * trip for trip in trips if trip is not None), default=1.0) or 1.0
    across, down = (width - 2 * EDGE) / max(1, len(trips) - 1), (height - 2 * EDGE) / top
    dots = ""
    for index, trip in enumerate(trips):
        y, color = (EDGE, "#e03131") if trip is None else (height - EDGE - 1e3 * trip * down, "#1c7ed6")
        dots += f'<circle cx="{EDGE + index * across:.1f}" cy="{y:.1f}" r="1.5" fill="{color}"/>'
    axis = f"M{EDGE} {EDGE} V{height - EDGE} H{width - EDGE}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-size="12">'
        f'<rect width="{width}" height="{height}" fill="white"/><path d="{axis}" stroke="#495057" fill="none"/>{dots}'
        f'<text x="{EDGE}" y="{EDGE - 10}">round trip, {top:.2f} ms at the top</text>'
        f'<text x="{EDGE}" y="{height - 12}">{len(trips)} questions</text></svg>\n'
    )
