"""Ends a process that must not outlive this one, however this one ends, SIGKILL included."""

from __future__ import annotations

import subprocess

# `read` returns when the other end of its pipe is closed, as all that a process has open is with its end.
AWAIT_AND_END = 'read -r _ignored; kill -TERM "$1"'


class Guard:
    """A shell that sends SIGTERM to process `pid` once this process is gone."""

    def __init__(self, pid: int) -> None:
        self._shell = subprocess.Popen(
            ("/bin/sh", "-c", AWAIT_AND_END, "guard", str(pid)),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def close(self) -> None:
        """It sends nothing any more: call it before the process is waited for, as its number may be another's then."""
        self._shell.kill()
        self._shell.communicate()
