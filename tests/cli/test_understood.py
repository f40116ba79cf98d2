"""Every command with numbers says back what it understood, in degrees and millimetres, before it asks the stack."""

from __future__ import annotations

import pytest

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

SAID = {
    "move --joints brazo_joint=0.5235987755982988rad q3=0.04": "brazo_joint 30 deg, efector_joint 40 mm",
    "move --to 0.25 150mm -0.1m --speed 50%": "tool to 250, 150, -100 mm; at 50 % speed",
    "move --to 0.2 0.1 0.1 --rpy 0 0 90deg --frame brazo_link": (
        "tool to 200, 100, 100 mm, in brazo_link, turned 90.0 deg about 0.00 0.00 1.00"
    ),
    "move --named left --planner PRM --seed 4 --time 3s --time-optimal": (
        'to the named state "left"; by PRM; seed 4; without a jerk limit; planned within 3 s'
    ),
    "move --named left --attempts 20": 'to the named state "left"; 20 attempts',
    "move --to 0.2 0.1 0.1 --line --tool-speed 0.05 --tool-acceleration 200mm/s2 --fraction 80% --max-step 2mm": (
        "tool to 200, 100, 100 mm; the tool in a straight line; at most 50 mm/s; at most 200 mm/s2; "
        "checked every 2 mm; at least 80 % of it"
    ),
    "move --to 0.2 0.1 0.1 --arc 0.2 0 0.1 --jump 0.5rad": (
        "tool to 200, 100, 100 mm; the tool on an arc through 200, 0, 100 mm; "
        "no joint jumping by more than 28.64789 deg"
    ),
    "move --via 0.1 0 0.1 --named ready --blend 10mm --ptp": (
        'tool to 100, 0, 100 mm, then to the named state "ready"; corners cut within 10 mm; '
        "in a straight line of the joints"
    ),
    "ik --to 0.2 0.1 0.1 --along 0 0 -1 --tolerance 0.002 --turn-tolerance 5deg --near q1=90deg": (
        "tool to 200, 100, 100 mm, its axis (0, 0, 1) along (0, 0, -1), within 2 mm, within 5 deg; "
        "near brazo_joint 90 deg"
    ),
    "fk q2=-45deg q3=20mm": "antebrazo_joint -45 deg, efector_joint 20 mm",
    "jog --joint q1=10deg/s q3=5mm/s --for 500ms": "brazo_joint 10 deg/s, efector_joint 5 mm/s for 0.5 s",
    "jog --twist 0.05 0 0 --turn 0 0 10deg/s --frame tool --for 1": (
        "tool at 50, 0, 0 mm/s, turning at 0, 0, 10 deg/s, along the axes of efector_link for 1 s"
    ),
    "scene add table --box 600mm 0.4 20mm --at 0.3 0 -10mm --rpy 0 0 90deg --padding 5mm": (
        "table, box 600 x 400 x 20 mm, at 300, 0, -10 mm, turned 90.0 deg about 0.00 0.00 1.00, in the base, "
        "5 mm kept around it"
    ),
    "scene add cup --cylinder 0.03 80mm --attach efector_link": (
        "cup, cylinder of radius 30, length 80 mm, at 0, 0, 0 mm, in efector_link"
    ),
    "scene move cup --at 0.1 0 20mm": "cup at 100, 0, 20 mm, in the base",
    "scene resize cup --sphere 0.03": "cup, sphere of radius 30 mm",
}


@pytest.mark.parametrize("line", SAID, ids=lambda line: line)
def test_what_was_understood_is_said_back(line, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    assert run(line.split()) is ExitCode.NO_STACK
    assert capsys.readouterr().out == f"understood: {SAID[line]}\n"


@pytest.mark.parametrize(
    "line", ["move --to 0.2 0.1 0.1 --json", "ik --to 0.2 0.1 0.1 --json", "fk q1=3deg --json", "fk --json"]
)
def test_json_is_not_mixed_with_words(line, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    assert run(line.split()) is ExitCode.NO_STACK
    assert capsys.readouterr().out == ""
