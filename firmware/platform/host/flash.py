"""The flash of a board: its configuration and its provisioned credentials.

The file is readable by its owner only, and nothing of the credentials is ever logged.
"""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

from gemelo.libraries.runtime.process.unwritten import Attempts, UnwrittenFiles


class NetworkCredentials(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The credentials of the device's network; a virtual device ignores those of the Wi-Fi."""

    device: str = ""  # empty: the configuration's name
    wifi_ssid: str = ""
    wifi_password: str = ""
    mqtt_uri: str = ""  # empty: the deployment's broker
    mqtt_user: str = ""
    mqtt_password: str = ""
    mqtt_ca: str = ""  # PEM
    mqtt_certificate: str = ""  # PEM, of the device itself
    mqtt_key: str = ""  # PEM, of that certificate
    update_key: str = ""  # PEM, the public key that a new firmware is signed for
    serial_baud: str = ""  # empty: 921600; a pseudo-terminal has none

    def __repr__(self) -> str:
        return f"Credentials(device={self.device!r}, mqtt_uri={self.mqtt_uri!r}, ...)"


class Content(msgspec.Struct, frozen=True, kw_only=True):
    """The file."""

    board: str
    configuration: str | None = None  # JSON text; None: what it left the factory with; empty: forgotten
    credentials: NetworkCredentials = NetworkCredentials()


class Flash:
    """The file of one board; one of another board, or one that cannot be read, counts as new."""

    def __init__(self, path: Path, board: str, unwritten: UnwrittenFiles) -> None:
        """`unwritten` gets what the disk refuses of the configuration."""
        self._path = path
        self._content = _read(path, board)
        self._attempts = Attempts(f"the configuration of {board} in {path}", unwritten)

    @property
    def configuration(self) -> str | None:
        return self._content.configuration

    @property
    def credentials(self) -> NetworkCredentials:
        return self._content.credentials

    def keep_configuration(self, text: str) -> bool:
        """Keep the configuration over a restart; False where the disk refuses it, and it is to be tried again."""
        return self._attempts.write(lambda: self._write(msgspec.structs.replace(self._content, configuration=text)))

    def keep_credentials(self, credentials: NetworkCredentials) -> None:
        """Keep the credentials over a restart; raises OSError."""
        self._write(msgspec.structs.replace(self._content, credentials=credentials))

    def forget(self) -> None:
        """Factory reset: neither configuration nor credentials; raises OSError."""
        self._write(Content(board=self._content.board, configuration=""))

    def _write(self, content: Content) -> None:
        beside = self._path.with_suffix(".tmp")
        beside.unlink(missing_ok=True)
        file = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(file, "wb") as stream:
            stream.write(msgspec.json.encode(content) + b"\n")
        os.replace(beside, self._path)
        self._content = content


def _read(path: Path, board: str) -> Content:
    try:
        content = msgspec.json.decode(path.read_bytes(), type=Content)
    except (OSError, msgspec.DecodeError):
        return Content(board=board)
    return content if content.board == board else Content(board=board)
