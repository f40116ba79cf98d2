"""The report of a chaos run: a table for the terminal, JSON for programs, and a page with a drawing."""

from __future__ import annotations

import html
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import median

import msgspec

from gemelo.tools.chaos.campaign import Episode

WIDTH, ROW = 720, 18  # [px] of the drawing, and of one fault's line
LONGEST = 25.0  # [s] at its right end


class ChaosReport(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that was done in one run. `violations` are those of no single episode: recordings, logs."""

    seed: int
    robot: str
    broker: str
    seconds: float
    only: tuple[str, ...] = ()  # the words that chose the faults; none: all of them
    episodes: tuple[Episode, ...]
    states_heard: int
    states_lost: int  # heard, not recorded, and not while logger or router were away
    violations: tuple[str, ...] = ()

    @property
    def is_good(self) -> bool:
        """True if every invariant held."""
        return not self.violations and not any(each.violations for each in self.episodes)


class FaultRow(msgspec.Struct, frozen=True, kw_only=True):
    """All episodes of one fault."""

    fault: str
    count: int
    ended: str
    to_end: float  # [s] median
    to_ready: float  # [s] median
    to_ready_max: float  # [s]
    hands: str
    violations: int


def rows_of(episodes: Iterable[Episode]) -> list[FaultRow]:
    """One row a fault, in the order of their names."""
    by_fault: dict[str, list[Episode]] = {}
    for episode in episodes:
        by_fault.setdefault(episode.fault, []).append(episode)
    return [_row(name, by_fault[name]) for name in sorted(by_fault)]


def _row(name: str, episodes: Sequence[Episode]) -> FaultRow:
    ends = Counter(each.ended for each in episodes)
    return FaultRow(
        fault=name,
        count=len(episodes),
        ended=", ".join(f"{count} {word}" for word, count in ends.most_common()),
        to_end=median(each.to_end for each in episodes),
        to_ready=median(each.to_ready for each in episodes),
        to_ready_max=max(each.to_ready for each in episodes),
        hands=", ".join(sorted({word for each in episodes for word in each.hands})) or "-",
        violations=sum(bool(each.violations) for each in episodes),
    )


def text_of(report: ChaosReport) -> str:
    """The table, then every violation with the command that repeats it."""
    rows = rows_of(report.episodes)
    wide = max((len(row.fault) for row in rows), default=5)
    ends = max((len(row.ended) for row in rows), default=5)
    lines = [f"{'fault':<{wide}}     n  {'the move':<{ends}}  told [s]  ready [s]   max  by hand"]
    lines += [
        f"{row.fault:<{wide}}  {row.count:>4}  {row.ended:<{ends}}  {row.to_end:>8.1f}  {row.to_ready:>9.1f}"
        f"  {row.to_ready_max:>4.1f}  {row.hands}{'   VIOLATED' if row.violations else ''}"
        for row in rows
    ]
    lines += ["", summary(report)]
    for episode in report.episodes:
        lines += [f"episode {episode.number}, {episode.chosen or episode.fault}: {each}" for each in episode.violations]
        if episode.violations:
            lines.append(f"  again: {again(report, episode)}")
    return "\n".join([*lines, *report.violations])


def again(report: ChaosReport, episode: Episode) -> str:
    """The command that repeats one episode: which fault it was depends on the faults that were chosen too."""
    only = f" --only {shlex.join(report.only)}" if report.only else ""
    return f"gemelo chaos --seed {report.seed}{only} --broker {report.broker} --episode {episode.number}"


def summary(report: ChaosReport) -> str:
    """One sentence."""
    bad = sum(bool(each.violations) for each in report.episodes)
    verdict = "every invariant held" if report.is_good else f"{bad} faults and {len(report.violations)} checks violated"
    lost = f"{report.states_lost} of {report.states_heard} joint states heard are not recorded"
    count, slots = len(report.episodes), sum(each.slots for each in report.episodes)
    rate = f"{60.0 * count / report.seconds:.1f} a minute" if report.seconds else "none"
    faults = f"{count} faults in {report.seconds:.0f} s ({rate}), seed {report.seed}"
    return f"{faults}: {verdict}; {slots} slots with steps judged; {lost}"


def page_of(report: ChaosReport) -> str:
    """The page: summary, drawing, table, violations; everything in one file."""
    escape = html.escape
    cells = "".join(
        f"<tr{' class=bad' if row.violations else ''}><td>{escape(row.fault)}<td>{row.count}<td>{escape(row.ended)}"
        f"<td>{row.to_end:.1f}<td>{row.to_ready:.1f}<td>{row.to_ready_max:.1f}<td>{escape(row.hands)}</tr>"
        for row in rows_of(report.episodes)
    )
    bad = "".join(
        f"<li>episode {each.number}, {escape(each.chosen or each.fault)}: {escape(word)}"
        for each in report.episodes
        for word in each.violations
    ) + "".join(f"<li>{escape(word)}" for word in report.violations)
    return f"""<!doctype html>
<html lang="en"><meta charset="utf-8"><title>gemelo chaos, seed {report.seed}</title>
<style>body{{font:14px system-ui;margin:2em;max-width:60em}}table{{border-collapse:collapse}}td,th{{padding:2px 10px;
text-align:left;border-bottom:1px solid #ddd}}.bad{{background:#fdd}}text{{font:12px system-ui}}</style>
<h1>Chaos on {escape(report.robot)}</h1><p>{escape(summary(report))}
<h2>From the end of the fault until everything is ready [s]</h2>{drawing_of(report.episodes)}
<h2>Faults</h2><table><tr><th>fault<th>n<th>the move<th>told [s]<th>ready [s]<th>max<th>by hand</tr>{cells}</table>
<h2>Violations</h2><ul>{bad or "<li>none"}</ul></html>
"""


def drawing_of(episodes: Sequence[Episode]) -> str:
    """An SVG with one line a fault and one dot an episode; red where an invariant did not hold."""
    names = sorted({each.fault for each in episodes})
    left, height = 190, ROW * len(names) + 24
    scale = (WIDTH - left - 20) / LONGEST
    lines = [f'<svg width="{WIDTH}" height="{height}" role="img">']
    for index, name in enumerate(names):
        y = ROW * index + 12
        lines.append(f'<text x="0" y="{y + 4}">{html.escape(name)}</text>')
        lines.append(f'<line x1="{left}" x2="{WIDTH}" y1="{y}" y2="{y}" stroke="#ddd"/>')
        for each in episodes:
            if each.fault == name:
                x = left + min(each.to_ready, LONGEST) * scale
                color = "#c00" if each.violations else "#06c"
                lines.append(f'<circle cx="{x:.1f}" cy="{y}" r="4" fill="{color}" fill-opacity=".5"/>')
    lines += [
        f'<text x="{left + seconds * scale:.1f}" y="{height - 2}">{seconds}</text>'
        for seconds in range(0, int(LONGEST) + 1, 5)
    ]
    return "".join([*lines, "</svg>"])
