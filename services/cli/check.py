"""`gemelo check`: what is wrong with a robot's folder, and what to do about it."""

from __future__ import annotations

from pathlib import Path

from services.arm.check import Severity
from services.arm.check import check as findings_in
from services.cli.exits import ExitCode


def check(folder: Path) -> ExitCode:
    """Prints every finding; fails if one of them is an error."""
    findings = findings_in(folder)
    for finding in findings:
        print(finding)
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    print(f"{folder}: {errors} errors, {len(findings) - errors} warnings" if findings else f"{folder}: all is well")
    return ExitCode.FAILED if errors else ExitCode.OK
