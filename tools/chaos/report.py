"""The report of a chaos run: a table for the terminal, JSON for programs, and a page with a drawing."""

from __future__ import annotations

import html
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from statistics import median

import msgspec

from gemelo.schemas.reasons import Reason, Value, because, plain
from gemelo.tools.chaos.campaign import Episode
from gemelo.tools.cli.common.language import columns, language, sentence, word
from gemelo.tools.cli.common.text_table import table

WIDTH, ROW = 720, 18  # [px] of the drawing, and of one fault's line
LONGEST = 25.0  # [s] at its right end
COLUMNS = ("fault", "n", "the move", "told [s]", "ready [s]", "max", "by hand", "violated")


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
    why: tuple[Reason, ...] = ()  # the same as data

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
        ended=", ".join(f"{count} {word('chaos', name)}" for name, count in ends.most_common()),
        to_end=median(each.to_end for each in episodes),
        to_ready=median(each.to_ready for each in episodes),
        to_ready_max=max(each.to_ready for each in episodes),
        hands=", ".join(word("hand", name) for name in sorted({name for each in episodes for name in each.hands}))
        or "-",
        violations=sum(bool(each.violations) for each in episodes),
    )


def text_of(report: ChaosReport) -> str:
    """The table, then every violation with the command that repeats it."""
    rows = rows_of(report.episodes)
    lines = [] if not rows else [table(columns(*COLUMNS), [_cells(row) for row in rows])]
    lines += ["", sentence(summary(report))]
    for episode in report.episodes:
        lines += map(sentence, violations_of(episode))
        if episode.violations:
            lines.append(f"  {sentence(because('chaos.again', command=again(report, episode)))}")
    return "\n".join([*lines, *_of_no_episode(report)])


def _cells(row: FaultRow) -> tuple[str, ...]:
    times = (f"{row.to_end:.1f}", f"{row.to_ready:.1f}", f"{row.to_ready_max:.1f}")
    return (row.fault, f"{row.count}", row.ended, *times, row.hands, f"{row.violations or '-'}")


def violations_of(episode: Episode) -> list[Reason]:
    """Each with its episode."""
    about: dict[str, Value] = {"number": episode.number, "fault": episode.chosen or episode.fault}
    return [because("chaos.episode", each, **about) for each in reasons_of(episode)]


def reasons_of(episode: Episode) -> tuple[Reason, ...]:
    """Of its violations."""
    return episode.why or tuple(map(plain, episode.violations))


def _of_no_episode(report: ChaosReport) -> list[str]:
    return list(map(sentence, report.why)) or list(report.violations)


def again(report: ChaosReport, episode: Episode) -> str:
    """The command that repeats one episode: which fault it was depends on the faults that were chosen too."""
    only = f" --only {shlex.join(report.only)}" if report.only else ""
    return f"gemelo chaos --seed {report.seed}{only} --broker {report.broker} --episode {episode.number}"


def summary(report: ChaosReport) -> Reason:
    """One sentence."""
    bad = sum(bool(each.violations) for each in report.episodes)
    not_held = because("chaos.not_held", faults=bad, checks=len(report.violations))
    found = (
        because("chaos.held") if report.is_good else not_held,
        because("chaos.judged", slots=sum(each.slots for each in report.episodes)),
        because("chaos.lost", lost=report.states_lost, heard=report.states_heard),
    )
    count = len(report.episodes)
    about: dict[str, Value] = {"count": count, "time": report.seconds, "seed": report.seed}
    if not report.seconds:
        return because("chaos.summary.no_time", *found, **about)
    return because("chaos.summary", *found, rate=60.0 * count / report.seconds, **about)


def page_of(report: ChaosReport) -> str:
    """The page: summary, drawing, table, violations; everything in one file."""
    escape = html.escape
    rows = "".join(
        f"<tr{' class=bad' if row.violations else ''}>{''.join(f'<td>{escape(cell)}' for cell in _cells(row))}</tr>"
        for row in rows_of(report.episodes)
    )
    headings = "".join(f"<th>{escape(name)}" for name in columns(*COLUMNS))
    told = [sentence(why) for each in report.episodes for why in violations_of(each)] + _of_no_episode(report)
    bad = "".join(f"<li>{escape(text)}" for text in told) or f"<li>{escape(word('chaos_page', 'none'))}"
    return f"""<!doctype html>
<html lang="{language()}"><meta charset="utf-8"><title>gemelo chaos, seed {report.seed}</title>
<style>body{{font:14px system-ui;margin:2em;max-width:60em}}table{{border-collapse:collapse}}td,th{{padding:2px 10px;
text-align:left;border-bottom:1px solid #ddd}}.bad{{background:#fdd}}text{{font:12px system-ui}}</style>
<h1>{escape(sentence(because("chaos.title", robot=report.robot)))}</h1><p>{escape(sentence(summary(report)))}
<h2>{escape(word("chaos_page", "until ready"))}</h2>{drawing_of(report.episodes)}
<h2>{escape(word("chaos_page", "faults"))}</h2><table><tr>{headings}</tr>{rows}</table>
<h2>{escape(word("chaos_page", "violations"))}</h2><ul>{bad}</ul></html>
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
