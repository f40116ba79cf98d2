"""No sentence that a person reads is built outside the catalogue of reasons, but for a short list of exceptions."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.house.counts import Module, modules
from tests.house.sentences import Sentence, made_sentences, sentences

FOLDERS = {  # whose sentences stand in the code, and why
    "docs/": "makes the pages of the documentation, for who works on them",
    "examples/": "is read as code, in English",
    "firmware/": "builds the core's bindings and drives the host's board, for tests",
    "tools/bench/": "measures, for who works on the project",
    "tools/replay/": "compares a recording with the code, for who works on that",
    "tools/stack/compose.py": "what process-compose itself reports, for who works on the project",
}
FOR_DEVELOPERS = {  # exceptions that no person is shown: a traceback or a log has them
    "AttributeError": "a mistake in a program",
    "EOFError": "between two processes of one node",
    "IndexError": "of a packet that is not whole, which is looked at again when it is",
    "FileNotFoundError": "an installation that is not whole, the catalogue itself among it",
    "RuntimeError": "a mistake in the project's own code",
    "TimeoutError": "a script's own wait",
    "TypeError": "a mistake in a program",
    "ValueError": "a mistake in a program; what a person can have written has an error of its own",
    "BadFrame": "counted, and named once in the log",
    "BadMessage": "counted, and named once in the log",
    "BadPacket": "counted, and named once in the log",
    "BadRaMessage": "counted, and named once in the log",
    "NoFrame": "counted, and named once in the log",
    "NativeMissing": "an installation that is not whole",
}
SINGLE = {  # by file and what carries it
    ("gemelo/api/homing.py", "Refused"): "two calls of a script, beside the reason",
    ("gemelo/pytest_plugin.py", "UsageError"): "of pytest, which speaks English",
    ("libraries/robot_import/xacro_sandbox/expressions.py", "KeyError"): "Python's own words, which xacro quotes",
    ("libraries/robot_import/xacro_sandbox/expressions.py", "NameError"): "Python's own words, which xacro quotes",
    ("libraries/robot_import/xacro_sandbox/process.py", "PermissionError"): "for code that breaks out of the sandbox",
    ("libraries/runtime/application.py", "ArgumentTypeError"): "the command line of a service, for its supervisor",
    ("libraries/runtime/process/shutdown.py", "print"): "a line of a service's log",
    ("services/planner/path/curve.py", "TurnsOnTheSpot"): "caught where the path is cut",
    ("services/visualizer/viewer.py", "say"): "a line of a service's log",
    ("tools/cli/bus/action_watch.py", "unknown"): "a kind of thing, which the catalogue has as `word.unknown`",
    ("tools/cli/robot/import_robot.py", "print"): "a line of shell to copy",
}
MADE = {  # of the command line, by file: what is put together there and is no sentence
    "tools/cli/bus/messages.py": "a mistake in a program",
    "tools/cli/common/terminal.py": "a form of numbers, with words of the catalogue",
    "tools/cli/device/link_bench.py": "names of files",
    "tools/cli/motion/jog.py": "a text of its help, which is a msgid",
    "tools/cli/motion/program.py": "a command to copy",
    "tools/cli/robot/import_robot.py": "a line of shell to copy",
    "tools/cli/version.py": "names with numbers",
    "tools/cli/watch/tf.py": "numbers with their units, as tf2_echo has them",
}


@pytest.fixture(scope="module")
def house() -> dict[str, Module]:
    return modules()


@pytest.fixture(scope="module")
def found(house: dict[str, Module]) -> dict[str, list[Sentence]]:
    """By the path of each file of the product."""
    return {str(each.path): list(sentences(each)) for each in house.values() if each.is_product}


@pytest.fixture(scope="module")
def made(house: dict[str, Module]) -> dict[str, list[Sentence]]:
    """Of the command line's own files."""
    here = {str(each.path): each for each in house.values() if str(each.path).startswith("tools/cli/")}
    return {path: list(made_sentences(each)) for path, each in here.items()}


def test_no_sentence_that_a_person_reads_is_built_outside_the_catalogue(found):
    others = {path: each for path, each in found.items() if not path.startswith(tuple(FOLDERS))}
    assert [
        f"{path}:{one.line} {one.carrier}: {one.text}"
        for path, each in others.items()
        for one in each
        if one.carrier not in FOR_DEVELOPERS and (path, one.carrier) not in SINGLE
    ] == []


def test_the_command_line_puts_no_sentence_together(made):
    """Whatever becomes of it: printed, a cell of a table, or a part of another one."""
    assert [f"{path}:{one.line}: {one.text}" for path, each in made.items() if path not in MADE for one in each] == []


def test_every_exception_is_needed(found, made):
    carriers = {(path, one.carrier) for path, each in found.items() for one in each}
    assert [place for place in SINGLE if place not in carriers] == []
    assert [name for name in FOR_DEVELOPERS if name not in {carrier for _, carrier in carriers}] == []
    assert [folder for folder in FOLDERS if not any(path.startswith(folder) for path, _ in carriers)] == []
    assert [path for path in MADE if not made[path]] == []


def module(*lines: str) -> Module:
    return Module(Path("a.py"), "a", "\n".join(lines))


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ('raise Refused("the wire is torn off")', 1),
        ('raise Refused(f"{wire} is torn off the {board}")', 1),
        ('raise Refused("a" if torn else f"{wire} is torn off there")', 1),
        ('raise Refused("torn: {} lies on the floor".format(wire))', 1),
        ('print("the wire is " + "torn off")', 1),
        ('block.say(f"{count} wires are torn off")', 1),
        ('raise Refused(because("wire.torn.off.the.board", wire=wire))', 0),
        ('raise Refused("wire.torn.off.the.board")', 0),
        ('print(sentence(because("wire.torn")))', 0),
        ('print(f"{wire}: {count} m")', 0),
        ('log("the wire is torn off")', 0),
    ],
)
def test_a_sentence_is_seen_where_it_is_raised_or_printed(line: str, count: int) -> None:
    assert len(list(sentences(module(line)))) == count


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ('text = f"{wire} is torn off the board"', 1),
        ('parser.add_argument("--wire", help=f"the wire that is torn off [{WIRE}]")', 0),
        ('parser.epilog = f"The wire is torn off.\\n\\n{parser.epilog}"', 0),
        ('svg = f\'<svg width="{wide}" height="{high}" fill="none" stroke="black">\'', 0),
        ('text = f"{wire} {count:.1f} m"', 0),
    ],
)
def test_a_sentence_is_seen_where_it_is_put_together(line: str, count: int) -> None:
    assert len(list(made_sentences(module(line)))) == count
