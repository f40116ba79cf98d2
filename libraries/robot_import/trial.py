"""The trial of a robot's folder in a process of its own: neither the command line nor an import loads the planner."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec

from gemelo.libraries.arm.checks.findings import Finding, error
from gemelo.libraries.arm.errors import Subject
from gemelo.schemas.reasons import because

TRIAL = "gemelo.services.planner.trial"


def trial_findings(folder: Path) -> list[Finding]:
    """What keeps plans from succeeding that nothing else has found; takes some seconds."""
    ended = subprocess.run([sys.executable, "-m", TRIAL, str(folder)], check=False, stdout=subprocess.PIPE, text=True)
    found = [msgspec.json.decode(line, type=Finding) for line in ended.stdout.splitlines()]
    if ended.returncode != 0:
        found.append(error(folder.name, Subject("trial"), because("trial.ended", code=ended.returncode)))
    return found
