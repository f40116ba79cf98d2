"""The embedded broker: a program of our own on mochi-mqtt (native/), which `make setup` builds."""

from __future__ import annotations

from pathlib import Path

from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.deployment import MqttSection
from gemelo.schemas.reasons import because
from gemelo.services.broker.replacement import NotInstalled

PROGRAM = ".gemelo/bin/gemelo-mqtt"  # deploy/embedded_broker.sh
PERSISTENCE = "embedded_broker.json"  # in mqtt.persistence_folder


def find() -> Path:
    """The path of the program; raises `NotInstalled`."""
    program = project_root() / PROGRAM
    if not program.is_file():
        raise NotInstalled(because("broker.none.embedded", file=PROGRAM))
    return program


def command(section: MqttSection) -> list[str]:
    """The program with its arguments: open, or with the lock that `gemelo broker secure` has made."""
    host, port = section.listening
    arguments = [str(find()), f"--listen={f'[{host}]' if ':' in host else host}:{port}"]
    if section.secure_folder:
        folder = secure_folder.require_made(Path(section.secure_folder))
        arguments += [
            f"--users={folder / secure_folder.USERS}",
            f"--acl={folder / secure_folder.ACL}",
            f"--certificate={folder / secure_folder.CERTIFICATE}",
            f"--key={folder / secure_folder.KEY}",
        ]
    if section.persistence_folder:
        arguments.append(f"--persistence={Path(section.persistence_folder) / PERSISTENCE}")
    return arguments
