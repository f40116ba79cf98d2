"""Another host to install on: a real sshd in a mount namespace, so that what root does there is not done here.

Its /etc, /usr/local, /var/lib and /run are layers of its own: its users, its units, its state. What it lacks is
systemd, in whose place `systemctl` writes down what it is told. Processes and ports are this machine's.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from gemelo.libraries.runtime.deployment import project_root
from tests.optional import need, need_root
from tests.runtime.support import free_port, until

SSHD = "/usr/sbin/sshd"
OWN = ("/etc", "/usr/local", "/var/lib")  # changed there alone
ENTER = """
set -e
mount -t tmpfs layers {layers}
own() {{  # the folder, and whether all may pass through it
    mkdir -p {layers}/upper$1 {layers}/work$1
    mount -t overlay overlay -o lowerdir=$1,upperdir={layers}/upper$1,workdir={layers}/work$1 $1
}}
for each in {own}; do own $each; done
for each in {closed}; do own $each; chmod 711 $each; done
mount -t tmpfs run /run
mkdir -p /run/sshd
usermod -p '*' root
printf '#!/bin/sh\\necho "$@" >>{calls}\\n' >/usr/local/sbin/systemctl
chmod 755 /usr/local/sbin/systemctl
exec {sshd} -D -e -f {folder}/sshd_config
"""
SSHD_CONFIG = """
Port {port}
ListenAddress 127.0.0.1
HostKey {folder}/host
AuthorizedKeysFile {folder}/person.pub
StrictModes no
UsePAM no
PasswordAuthentication no
PermitRootLogin prohibit-password
PidFile none
"""
SSH_CONFIG = """
Host *
    Port {port}
    IdentityFile {folder}/person
    IdentitiesOnly yes
    UserKnownHostsFile {folder}/known
    StrictHostKeyChecking yes
    BatchMode yes
"""


class OtherHost:
    """At 127.0.0.1, for the programs `ssh` and `rsync` of `path`."""

    def __init__(self, folder: Path) -> None:
        need("sshd")
        need("rsync")
        need_root("tests/stack/test_install.py")
        self.folder, self.calls = folder, folder / "systemctl"
        (folder / "layers").mkdir(parents=True)
        for name in ("host", "person"):
            self._do("ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(folder / name))
        port = free_port()
        (folder / "known").write_text(f"[127.0.0.1]:{port} {(folder / 'host.pub').read_text()}")
        (folder / "sshd_config").write_text(SSHD_CONFIG.format(folder=folder, port=port))
        (folder / "ssh_config").write_text(SSH_CONFIG.format(folder=folder, port=port))
        self._write_ssh()
        words = ENTER.format(
            layers=folder / "layers", own=" ".join(OWN), closed=" ".join(map(str, closed_folders())),
            calls=self.calls, sshd=SSHD, folder=folder,
        )  # fmt: skip
        with (folder / "sshd.log").open("wb") as log:
            self.sshd = subprocess.Popen(
                ["unshare", "--mount", "sh", "-c", words], stdout=log, stderr=log, start_new_session=True
            )
        assert until(lambda: "Server listening" in self.log or self.sshd.poll() is not None, 20.0)
        assert self.sshd.poll() is None, self.log

    @property
    def log(self) -> str:
        return (self.folder / "sshd.log").read_text(errors="replace")

    @property
    def path(self) -> str:
        """PATH with an ssh that knows port and keys."""
        return f"{self.folder / 'bin'}:{os.environ['PATH']}"

    def run(self, *words: str, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
        """A command there, by root, as one line of a shell."""
        return subprocess.run(
            ["ssh", "root@127.0.0.1", *words], env=os.environ | {"PATH": self.path}, capture_output=True, text=True,
            timeout=timeout, check=False,
        )  # fmt: skip

    def start(self, *words: str, log: Path) -> subprocess.Popen[bytes]:
        """A command there that goes on."""
        with log.open("wb") as file:
            return subprocess.Popen(
                ["ssh", "root@127.0.0.1", *words], env=os.environ | {"PATH": self.path}, stdin=subprocess.DEVNULL,
                stdout=file, stderr=subprocess.STDOUT,
            )  # fmt: skip

    def close(self) -> None:
        self.sshd.terminate()
        self.sshd.wait(timeout=60.0)

    def _write_ssh(self) -> None:
        program = self.folder / "bin/ssh"
        program.parent.mkdir()
        program.write_text(f'#!/bin/sh\nexec {shutil.which("ssh")} -F {self.folder}/ssh_config "$@"\n')
        program.chmod(0o755)

    @staticmethod
    def _do(*words: str) -> None:
        subprocess.run(words, check=True, capture_output=True)


def closed_folders() -> Iterator[Path]:
    """The outermost folders above project and interpreter that only their owner may pass through."""
    found: dict[Path, None] = {}
    for file in (project_root() / "here", Path(sys.executable).resolve()):
        for folder in reversed(file.parents):
            if not folder.stat().st_mode & 0o001:
                found[folder] = None
                break
    yield from found
