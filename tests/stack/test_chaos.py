"""A minute of chaos on a whole stack: every invariant holds."""

from __future__ import annotations

import json
import subprocess
import sys

from tests.optional import need

SEED = 1


def test_a_minute_of_chaos_violates_nothing(tmp_path, pytestconfig):
    need("mosquitto")
    command = [sys.executable, "-m", "services.cli.main", "chaos", "--minutes", "1", "--seed", str(SEED)]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "out")],
        cwd=pytestconfig.rootpath, capture_output=True, text=True, timeout=240.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "out/report.json").read_text())
    assert len(report["episodes"]) >= 4
    assert (report["states_lost"], report["violations"]) == (0, [])
    assert (tmp_path / "out/report.html").read_text().count("<circle") == len(report["episodes"])
