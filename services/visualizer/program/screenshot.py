"""A picture of the viewer as it opens a recording, taken without a display.

The program's own `--screenshot-to` shoots before a recording has been loaded; this asks the running viewer.
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rerun.experimental import ViewerClient

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because, plain
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.program.rerun_program import LOOPBACK, environment, free_port, rerun_binary

SETTLE = 6.0  # [s] until the viewer's own notices have gone and every chunk is drawn
DRAWN = 1.5  # [s] until another time is drawn
# The viewer's words where it finds nothing that draws (Rerun 0.34: wgpu's, or its own without a render context).
NOTHING_DRAWS = re.compile(r"(?i)render context|no suitable .*adapter|adapter.*not found|(?:create|request).*adapter")


class NoPicture(ReasonedError, RuntimeError):
    """The viewer takes no picture of a recording."""


class NoGraphics(NoPicture):
    """Nothing draws on this machine."""


def save_screenshot(
    rrd: Path, png: Path, size: tuple[int, int] = (1600, 900), timeout: float = 60.0, at: int | None = None
) -> Path:
    """Write `png` of `size` [pixels] from the recording `rrd`; raises `NoPicture` with the viewer's own words.

    `at` [ns] UNIX is the time on the timeline "time" that it shows; absent: where the recording opens.
    """
    if not rrd.is_file():
        raise NoPicture(because("recording.picture.none", file=str(rrd)))
    png.parent.mkdir(parents=True, exist_ok=True)
    deadline = time.monotonic() + timeout
    with _headless_viewer(rrd, png.with_suffix(".viewer.log"), size) as (viewer, port):
        client = _connected(viewer, port, deadline)
        _settle(client, deadline)
        if at is not None:
            client.set_time(timeline=entities.TIMELINE, timestamp=np.datetime64(at, "ns"), play_state="paused")
            time.sleep(DRAWN)
        png.write_bytes(client.take_screenshot(max_size=max(size)))
    return png


@contextmanager
def _headless_viewer(rrd: Path, log: Path, size: tuple[int, int]) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    port = free_port()
    command = [
        str(rerun_binary()), str(rrd), "--headless", "--window-size", f"{size[0]}x{size[1]}",
        "--bind", LOOPBACK, "--port", str(port),
    ]  # fmt: skip
    with log.open("wb") as output:
        viewer = subprocess.Popen(command, env=environment(os.environ), stdout=output, stderr=output)
    try:
        yield viewer, port
    except Exception as error:
        words = log.read_text(errors="replace")
        if NOTHING_DRAWS.search(words):
            raise NoGraphics(because("recording.no_graphics")) from error
        why = error.reason if isinstance(error, ReasonedError) else plain(str(error))
        raise NoPicture(because("recording.picture.failed", why, file=str(rrd), text=_main_words(words))) from error
    finally:
        viewer.kill()
        viewer.wait()
        log.unlink(missing_ok=True)


def _main_words(text: str) -> str:
    """The viewer's own complaint, else its last line, without colours and the backtrace."""
    lines = [line.strip() for line in re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines() if line.strip()]
    complaints = [line for line in lines if re.search(r"panicked|ERROR|[Ee]rror:", line)]
    return " ".join([*complaints[:2], *([] if complaints else lines[-1:])])[:600] or "nothing"


def _connected(viewer: subprocess.Popen[bytes], port: int, deadline: float) -> ViewerClient:
    while viewer.poll() is None and time.monotonic() < deadline:
        with socket.socket() as probe:
            probe.settimeout(0.2)
            if probe.connect_ex((LOOPBACK, port)) == 0:
                return ViewerClient.connect(f"rerun+http://{LOOPBACK}:{port}/proxy")
        time.sleep(0.1)
    raise NoPicture(because("recording.picture.not_started"))


def _settle(client: ViewerClient, deadline: float) -> None:
    """Wait until the recording has been loaded for `SETTLE` seconds."""
    loaded_since = time.monotonic()
    while time.monotonic() - loaded_since < SETTLE:
        if time.monotonic() > deadline:
            raise NoPicture(because("recording.picture.not_loaded"))
        state = client.get_state()
        if state.loading or not any(recording.timelines for recording in state.recordings):
            loaded_since = time.monotonic()
        time.sleep(0.25)
