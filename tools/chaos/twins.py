"""Two of one kind: a second process beside one of the stack's, which gives way or which the first gives way to."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import psutil
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.stack.stack import Stack, StackError

TO_BEGIN = 60.0  # [s] until a second process has loaded all and shows itself, on a machine without time
TO_GIVE_WAY = 20.0  # [s] from there until it has looked around and ended
TO_END = 10.0  # [s] after its SIGTERM
POLL = 0.05  # [s]
BACK_AT_ONCE = 1  # [s] after which a client whose id was taken over comes again, where it does


class TwinProcess:
    """A second process of the stack's `name`, with the same environment, from `start` to `end`."""

    def __init__(self, stack: Stack, name: str) -> None:
        self.name, self._stack = name, stack
        self._log = stack.out / "logs" / f"twin_of_{name}.log"
        self._process: subprocess.Popen[bytes] | None = None
        self.first = stack.pid(name)  # the process id of the stack's own

    def start(self) -> None:
        """Starts the second process."""
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [str(self._stack.root / ".venv/bin" / f"gemelo-{self.name.replace('_', '-')}")],
                cwd=self._stack.root, env=self._stack.environment, stdin=subprocess.DEVNULL, stdout=log,
                stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip

    def end(self) -> None:
        """Ends the second process, if it has not ended by itself."""
        process, self._process = self._process, None
        if process is None:
            return
        process.terminate()
        try:
            process.wait(TO_END)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    @property
    def has_ended(self) -> bool:
        """True if the second process has ended by itself."""
        return self._process is None or self._process.poll() is not None

    def gave_way(self) -> list[Reason]:
        """Waits until the second one has ended; what of that is wrong."""
        if not _until(self._has_shown_itself, TO_BEGIN):
            return [because("chaos.twin.not_begun", name=self.name, time=TO_BEGIN)]
        if not _until(lambda: self.has_ended, TO_GIVE_WAY):
            return [because("chaos.twin.beside", name=self.name, time=TO_GIVE_WAY)]
        found = self._untold()
        if self._stack.pid(self.name) != self.first:
            found.append(because("chaos.twin.first_ended", name=self.name))
        return found

    def has_begun(self) -> bool:
        """Waits until the second one has begun its work: it says so where a process says that it is alive."""
        return _until(lambda: self.has_ended or self._is_at_work(), TO_BEGIN) and not self.has_ended

    def one_is_left(self) -> list[Reason]:
        """Waits until one of both has ended; what of that is wrong."""
        if not _until(lambda: self.has_ended or not psutil.pid_exists(self.first), TO_GIVE_WAY):
            return [because("chaos.twin.both", name=self.name, time=TO_GIVE_WAY)]
        return self._untold() if self.has_ended else []

    def _is_at_work(self) -> bool:
        alive = self._stack.run / f"{self.name}.alive"
        return self._process is not None and _first_word(alive) == str(self._process.pid)

    def _has_shown_itself(self) -> bool:
        return self.has_ended or self._log.stat().st_size > 0 or self._is_at_work()

    def _untold(self) -> list[Reason]:
        said = self._log.read_text(errors="replace").strip()
        is_told = said and "Traceback" not in said
        return [] if is_told else [because("chaos.twin.silent", name=self.name, text=said)]


class TwinClient:
    """A second client of the broker with the id of another one, from its making until `close`.

    `comes_back`: it connects again, as the other does, whenever that has taken its connection.
    """

    def __init__(self, port: int, client_id: str, comes_back: bool) -> None:
        self._client = Client(CallbackAPIVersion.VERSION2, client_id=client_id, reconnect_on_failure=comes_back)
        self._client.on_connect = lambda client, *_: client.subscribe("gemelo/v1/#", qos=1)
        self._client.on_message = _ignore
        self._client.reconnect_delay_set(BACK_AT_ONCE, BACK_AT_ONCE)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def close(self) -> None:
        """Leaves the broker."""
        self._client.disconnect()
        stop_loop(self._client)


def _ignore(_client: Client, _data: object, _message: MQTTMessage) -> None: ...


def _first_word(file: Path) -> str:
    try:
        return next(iter(file.read_text().split()), "")
    except OSError:
        return ""


def _until(is_so: Callable[[], bool], seconds: float) -> bool:
    """Waits up to `seconds` [s]; True once it is so."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if is_so():
                return True
        except StackError:
            pass
        time.sleep(POLL)
    return False
