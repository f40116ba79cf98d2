"""The openssl command, which judges what the project's own certificates and keys are."""

from __future__ import annotations

import subprocess


def openssl(*arguments: str) -> str:
    """What it prints; a test that is given it is left out where it is missing."""
    return subprocess.run(["openssl", *arguments], capture_output=True, text=True, check=True).stdout
