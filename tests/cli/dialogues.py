"""Dialogues with the command line in every language: commands on a simulated arm, and their golden files.

`python -m tests.cli.dialogues` makes the files anew: read the difference as a reader of each language would.
"""

from __future__ import annotations

import io
import re
import shlex
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.cli.main import run

FOLDER = Path(__file__).parent / "dialogues"
LANGUAGES = ("en", "es")
LONGEST = 1200  # characters of an answer that are kept: lists of every topic grow
PROMPT = "$ gemelo "
MASKED = (  # what differs from one run, or from one release, to the next
    (re.compile(r"\d+\.\d+(?= m?s\b)"), "<time>"),
    (re.compile(r"(?<=boot )[0-9a-f]{8}|(?<=arranque )[0-9a-f]{8}|(?<=crc32 )[0-9a-f]{8}"), "<number>"),
    (re.compile(r"(?<=firmware )\d+\.\d+\.\d+"), "<version>"),
)
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
explain update.nobody
explain measure
check nowhere
nothing
--simulate move --joints brazo_joint=10deg --plan-only
--simulate move --to 0.25 0.15 0.1 --line --fraction 80% --tool-speed 50mm/s --plan-only
--simulate home
--simulate verify
--simulate state
--simulate device status
--simulate control who
--simulate jog
--simulate stop --ready
--simulate ik --to 0.25 0.15 0.10 --near q1=90deg
--simulate scene add table --box 600mm 0.4 20mm --at 0.3 0 -0.3 --padding 5mm
--simulate scene list
--simulate grip
--simulate sensors
--simulate device press estop
--simulate device press switch limit_q1 down
--simulate device press slip q1 many
--simulate device config --push
--simulate action cancel follow_joint_trajectory abc
--simulate tf echo base_link nothing
move --execute nowhere.json
bag info nowhere.mcap
blackbox show nowhere.mcap
bag play --rate 0 nowhere.mcap
deploy check nowhere
device update
device update nowhere.bin
device update --make-key --key my.pub
device provision --serial no_port --device rm1
device provision --serial no_port
device provision --serial no_port --device rm1 --mqtt-uri 10.0.0.2
device doctor --serial no_port
broker secure --serial no_port --device a b
link bench --rate 300
camera print tags --page a4 --to nowhere/board.pdf
import nowhere
import tests/cli/dialogues/mended.urdf --yes --output tests/cli --name dialogues
import tests/cli/dialogues/broken.urdf --yes
collision matrix nowhere
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
    for pattern, mask in MASKED:
        text = pattern.sub(mask, text)
    text = f"{text[:LONGEST]} ..." if len(text) > LONGEST else text
    return f"{PROMPT}{command}\n{text}\n[{code}]\n"


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
