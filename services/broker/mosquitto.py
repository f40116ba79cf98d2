"""mosquitto as the broker, with a configuration that is written at the start."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from pathlib import Path

from gemelo.libraries.mqtt import secure_folder
from gemelo.schemas.deployment import MqttSection
from gemelo.schemas.reasons import because
from gemelo.services.broker.replacement import NotInstalled

OPEN = "allow_anonymous true"
CONFIGURATION = "mosquitto.conf"


def find() -> str:
    """The path of mosquitto, also where Debian keeps it out of a user's PATH; raises `NotInstalled`."""
    path = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/usr/local/sbin"])
    found = shutil.which("mosquitto", path=path)
    if found is None:
        raise NotInstalled(because("broker.none.mosquitto"))
    return found


def command(section: MqttSection, run: Path) -> list[str]:
    """mosquitto with its configuration, which is written to `run`."""
    program = find()
    if section.persistence_folder:
        with suppress(OSError):  # mosquitto itself says what it cannot write, and goes on
            Path(section.persistence_folder).mkdir(mode=0o700, parents=True, exist_ok=True)
    return [program, "-c", configuration_file(run, configuration(section))]


def configuration(section: MqttSection) -> str:
    """The text of mosquitto.conf: open, or with the lock that `gemelo broker secure` has made."""
    host, port = section.listening
    door = secure_folder.listener(Path(section.secure_folder)) if section.secure_folder else OPEN
    if os.geteuid() == 0 and (section.secure_folder or section.persistence_folder):
        door = f"user root\n{door}"  # started by root, mosquitto would become a user who cannot read these files
    return secure_folder.mosquitto_conf(host, port, door, section.persistence_folder)


def configuration_file(run: Path, text: str) -> str:
    """The path of a file with it in `run`; where that disk takes none, of one in memory that the program inherits."""
    try:
        run.mkdir(parents=True, exist_ok=True)
        (run / CONFIGURATION).write_text(text)
    except OSError:
        held = os.memfd_create(CONFIGURATION, 0)
        os.write(held, text.encode())
        return f"/proc/self/fd/{held}"
    return str(run / CONFIGURATION)
