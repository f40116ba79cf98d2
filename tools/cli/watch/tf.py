"""`gemelo tf`: the frames as a tree, the pose of one in another, and how often and how late each comes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import escape

import msgspec

from gemelo.libraries.arm.frames.frame_buffer import FrameBuffer, FrameError
from gemelo.libraries.arm.frames.transforms import to_rpy
from gemelo.schemas.frames import FrameTransform, FrameTransforms
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import FRAMES, STATIC_FRAMES
from gemelo.tools.cli.bus.field_path import FieldPath
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown
from gemelo.tools.cli.common.forms import (
    Form,
    count_options,
    form_of,
    form_options,
    print_value,
    rows_form_of,
    yaml_document,
)
from gemelo.tools.cli.common.language import columns, sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option, positive_number

if TYPE_CHECKING:
    from gemelo import Robot

HEARD_FOR = 0.6  # [s] within which every frame that moves has come thirty times
REPORT_EVERY = 1.0  # [s]
ROW, INDENT, WIDTH, HEIGHT, SIGN = 34, 30, 210, 24, 7.2  # [pixels] of the picture; SIGN of a letter


class FrameLink(NamedTuple):
    """How a frame hangs on its parent."""

    parent: str
    is_static: bool


def echo_options(parser: Parser) -> None:
    """Adds both frames, rate, field, count and form."""
    parser.add_argument("target", metavar="PARENT", help="the frame in which it is said")
    parser.add_argument("source", metavar="CHILD", help="the frame whose pose it is")
    parser.add_argument("-r", "--rate", type=positive_number, default=1.0, metavar="HZ", help="else once a second")
    parser.add_argument("--field", default="", metavar="PATH", help="of it only this, as transform.translation[2] [m]")
    count_options(parser, "poses")
    form_options(parser)


def run_echo(options: Options) -> ExitCode:
    """Prints poses until Ctrl-C."""
    field = FieldPath(FrameTransform, options.field)  # a mistake is told before anything is connected
    form = form_of(options, yaml_document if options.field else pose_text)
    with connect() as session:
        return echo(session, options.target, options.source, options.rate, options.count, form, field)


def tree_options(parser: Parser) -> None:
    """Adds --svg and --json."""
    json_option(parser)
    parser.add_argument("--svg", type=Path, metavar="FILE", help="also as a picture")


def run_tree(options: Options) -> ExitCode:
    """Prints the tree."""
    with connect() as session:
        links = heard(session).links
    print_value(tree_frames(links), options.json, lambda: tree_text(links))
    if options.svg is not None:
        try:
            options.svg.write_text(tree_picture(links), encoding="utf-8")
        except OSError as error:
            raise CommandError(
                because("cli.file.unwritable", file=str(options.svg), error=str(error.strerror))
            ) from error
    return ExitCode.OK


def monitor_options(parser: Parser) -> None:
    """Adds count and form."""
    count_options(parser, "reports")
    form_options(parser)


def run_monitor(options: Options) -> ExitCode:
    """Prints a table a second, until Ctrl-C."""
    with connect() as session:
        return monitor(session, options.count, rows_form_of(options, monitor_table))


def choices(robot: Robot | None) -> Choices:
    """The links."""
    names = robot.description.model.link_names if robot is not None else ()
    return {"": names, **dict.fromkeys(names, names)}


@dataclass
class HeardFrames:
    """What has come of the frames."""

    buffer: FrameBuffer = field(default_factory=FrameBuffer)
    links: dict[str, FrameLink] = field(default_factory=dict)  # by child

    def take(self, frames: FrameTransforms, is_static: bool) -> None:
        self.buffer.insert_all(frames, is_static)
        for frame in frames.transforms:
            self.links[frame.child] = FrameLink(frame.parent, is_static)


def heard(session: CommandSession) -> HeardFrames:
    """The frames that come within a while; raises `CommandError` where none does."""
    known = _listen(session)
    session.node.wait(HEARD_FOR)
    if not known.links:
        raise CommandError(because("cli.tf.silent"), ExitCode.NO_STACK)
    return known


def _listen(session: CommandSession) -> HeardFrames:
    known = HeardFrames()
    session.node.subscribe(STATIC_FRAMES, lambda frames: known.take(frames, True))
    session.node.subscribe(FRAMES, lambda frames: known.take(frames, False))
    return known


def echo(
    session: CommandSession, target: str, source: str, rate: float, count: int | None, form: Form, field: FieldPath
) -> ExitCode:
    """Prints the pose of `source` in `target`, or a field of it, `rate` [1/s] times.

    Raises `CommandError` where a frame is unknown.
    """
    known = heard(session)
    for name in (target, source):
        if name not in known.buffer.frames:
            raise unknown("frame", name, list(known.buffer.frames))
    printed = 0

    def step(now: int) -> None:
        nonlocal printed
        try:
            found = known.buffer.look_up_stamped(target, source)
        except FrameError as error:
            raise CommandError(error) from error
        print(form(field.of(found)), flush=True)
        printed += 1
        if printed == count:
            session.node.stop()

    session.node.spin(step, rate=rate)
    return ExitCode.OK


def pose_text(found: FrameTransform) -> str:
    """Point [mm], roll, pitch and yaw [deg], quaternion, one line each, in the form of `tf2_echo`."""
    x, y, z = found.transform.translation
    a, b, c, w = found.transform.rotation
    roll, pitch, yaw = (math.degrees(angle) for angle in to_rpy((a, b, c, w)))
    heading = sentence(because("cli.tf.pose", child=found.child, parent=found.parent))
    return (
        f"{heading}\n"
        f"  point       {1000.0 * x:.2f} {1000.0 * y:.2f} {1000.0 * z:.2f} mm\n"
        f"  rpy         {roll:.3f} {pitch:.3f} {yaw:.3f} deg\n"
        f"  quaternion  {a:.6f} {b:.6f} {c:.6f} {w:.6f}"
    )


def _children(links: Mapping[str, FrameLink]) -> tuple[list[str], dict[str, list[str]]]:
    """The frames without a parent, and of every frame those that hang on it, by name."""
    below: dict[str, list[str]] = {}
    for child, link in sorted(links.items()):
        below.setdefault(link.parent, []).append(child)
    return sorted(set(below) - set(links)), below


def tree_rows(links: Mapping[str, FrameLink]) -> list[tuple[int, str]]:
    """Every frame with its depth, in the order in which a tree is drawn from the top."""
    roots, below = _children(links)
    rows: list[tuple[int, str]] = []
    waiting = [(0, root) for root in reversed(roots)]
    while waiting:
        depth, name = waiting.pop()
        rows.append((depth, name))
        waiting += [(depth + 1, child) for child in reversed(below.get(name, ()))]
    return rows


def tree_frames(links: Mapping[str, FrameLink]) -> list[dict[str, object]]:
    """Every frame with its parent, None for a root, in the same order."""
    parents = {name: link.parent for name, link in links.items()}
    return [
        {"frame": name, "parent": parents.get(name), "fixed": name in links and links[name].is_static}
        for _, name in tree_rows(links)
    ]


def tree_text(links: Mapping[str, FrameLink]) -> str:
    """A line for every frame, indented by its depth; fixed ones say so."""
    lines = []
    for depth, name in tree_rows(links):
        is_fixed = name in links and links[name].is_static
        lines.append(f"{'  ' * depth}{name}{' (fixed)' if is_fixed else ''}")
    return "\n".join(lines)


def tree_picture(links: Mapping[str, FrameLink]) -> str:
    """The same as SVG: a box for every frame, a dashed line to a fixed one."""
    rows = tree_rows(links)
    place = {name: row for row, (_, name) in enumerate(rows)}
    depths = {name: depth for depth, name in rows}
    parts = []
    for depth, name in rows:
        x, y = 10 + depth * INDENT, 10 + place[name] * ROW
        width = max(WIDTH, int(SIGN * len(name)) + 20)
        if name in links:
            parent = links[name].parent
            px, py = 22 + depths[parent] * INDENT, 10 + place[parent] * ROW + HEIGHT
            dash = ' stroke-dasharray="4 3"' if links[name].is_static else ""
            parts.append(f'<path d="M{px} {py} V{y + HEIGHT // 2} H{x}" fill="none" stroke="#666"{dash}/>')
        look = 'rx="4" fill="#eef4fb" stroke="#1c7ed6"'
        parts.append(f'<rect x="{x}" y="{y}" width="{width}" height="{HEIGHT}" {look}/>')
        parts.append(f'<text x="{x + 10}" y="{y + 16}">{escape(name)}</text>')
    wide = max((30 + depth * INDENT + max(WIDTH, int(SIGN * len(name)) + 20) for depth, name in rows), default=0)
    style = 'font-family="monospace" font-size="12"'
    size = f'width="{wide}" height="{20 + len(rows) * ROW}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>{"".join(parts)}</svg>\n'


class Arrivals:
    """When the samples of one frame came, and how old each was then [s]."""

    def __init__(self) -> None:
        self.times: deque[float] = deque(maxlen=1000)  # [s] monotonic
        self.delays: deque[float] = deque(maxlen=1000)

    def add(self, now: float, delay: float) -> None:
        """A sample that came at `now` [s] monotonic, `delay` [s] old."""
        self.times.append(now)
        self.delays.append(delay)

    @property
    def rate(self) -> float:
        """[Hz]; 0 after fewer than two."""
        span = self.times[-1] - self.times[0] if len(self.times) > 1 else 0.0
        return (len(self.times) - 1) / span if span > 0.0 else 0.0


class FrameRate(msgspec.Struct, frozen=True, kw_only=True):
    """How often and how late a moving frame came."""

    frame: str
    rate: float  # [Hz]
    delay_mean: float  # [s]
    delay_max: float  # [s]


def monitor(session: CommandSession, count: int | None, form: Form) -> ExitCode:
    """Prints rate and delay of every moving frame once a second."""
    arrivals: dict[str, Arrivals] = {}
    node, reports, last = session.node, 0, session.node.monotonic()

    def on_frames(frames: FrameTransforms) -> None:
        for frame in frames.transforms:
            arrivals.setdefault(frame.child, Arrivals()).add(node.monotonic(), (node.now() - frame.stamp) / 1e9)

    def step(now: int) -> None:
        nonlocal reports, last
        if node.monotonic() - last < REPORT_EVERY:
            return
        last = node.monotonic()
        if not arrivals and form is not monitor_table:
            return  # a program waits for the first frame
        print(form(rates_of(arrivals)), flush=True)
        reports += 1
        if reports == count:
            node.stop()

    node.subscribe(FRAMES, on_frames)
    node.spin(step, rate=20.0)
    return ExitCode.OK


def rates_of(arrivals: Mapping[str, Arrivals]) -> list[FrameRate]:
    """Rate and delay, by the frame's name."""
    return [
        FrameRate(
            frame=name,
            rate=each.rate,
            delay_mean=sum(each.delays) / len(each.delays),
            delay_max=max(each.delays),
        )
        for name, each in sorted(arrivals.items())
    ]


def monitor_table(rates: Sequence[FrameRate]) -> str:
    """The table for a person."""
    if not rates:
        return "no moving frame has come"
    rows = [
        (each.frame, f"{each.rate:.1f}", f"{1000.0 * each.delay_mean:.1f}", f"{1000.0 * each.delay_max:.1f}")
        for each in rates
    ]
    return table(columns("frame", "rate [Hz]", "mean delay [ms]", "most [ms]"), rows)
