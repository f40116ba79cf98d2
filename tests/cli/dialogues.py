"""Dialogues with the command line in every language: commands on a simulated arm, and their golden files.

`python -m tests.cli.dialogues` makes the files anew: read the difference as a reader of each language would.
"""

from __future__ import annotations

import io
import shlex
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.cli.main import run

FOLDER = Path(__file__).parent / "dialogues"
LANGUAGES = ("en", "es")
LONGEST = 400  # characters of an answer that are kept: lists of every topic grow
COMMANDS = """
--simulate move --joints brazo_joint=400deg
--simulate move --to 9 0 0
--simulate move --named nowhere
--simulate move --joints elbow=1
--simulate move
--simulate move --named ready --speed 200%
--simulate move --joints brazo_joint=0 antebrazo_joint=154deg efector_joint=0
--simulate move --named ready --planner RRTX
--simulate move --to 0.25 0.15 0.1 --line --arc 0.2 0 0.1
--simulate=unreferenced move --named ready
--simulate home elbow
--simulate output pump on
--simulate speed 120%
--simulate grip 90mm
--simulate ik --to 9 0 0
--simulate device press nothing
--simulate device press block elbow
--simulate reference --joints brazo_joint=400deg
--simulate program check nothing
--simulate resume
--simulate hold
--simulate device arm
--simulate device disarm
--simulate grip 20mm
--simulate device selftest --current q1=fast
--simulate jog elbow
--simulate topic echo nothing
--simulate node info planer
--simulate request call nothing
--simulate interface show Nothing
--simulate scene remove box
--simulate param set planner nothing 3
--simulate verify elbow
--robot tcp/127.0.0.1:1 state
--lang xx state
device flash --image none.zip --port x --yes
explain plan.nothing
explain device.estop.pressed
check nowhere
nothing
""".strip().splitlines()


def said(command: str, language: str) -> str:
    """What it prints in the language, with its exit code, and without the folders of this machine."""
    printed = io.StringIO()
    with redirect_stdout(printed), redirect_stderr(printed):
        try:
            code = int(run(["--lang", language, *shlex.split(command)]))
        except SystemExit as ended:  # the parser's own
            code = int(ended.code or 0)
    text = printed.getvalue().replace(str(project_root()), "<project>").rstrip()
    text = f"{text[:LONGEST]} ..." if len(text) > LONGEST else text
    return f"$ gemelo {command}\n{text}\n[{code}]\n"


def golden(language: str) -> Path:
    """The file of a language."""
    return FOLDER / f"{language}.txt"


def main() -> None:
    """Writes the files."""
    FOLDER.mkdir(exist_ok=True)
    for language in LANGUAGES:
        golden(language).write_text("\n".join(said(command, language) for command in COMMANDS), encoding="utf-8")


if __name__ == "__main__":
    main()
