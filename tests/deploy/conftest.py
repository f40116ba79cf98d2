"""A copy of what the bootstrap needs, on a machine whose programs the test chooses."""

from __future__ import annotations

import shutil
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root

COMMON = """bash sh cat chmod cut dirname env find flock grep head ln mkdir mktemp mv
    rm sed sha256sum sleep sort touch tr uname"""
UV = """#!/bin/sh
echo "uv $*" >> "$HOME/uv.log"
mkdir -p .venv/bin
ln -sf "$(command -v python3)" .venv/bin/python
touch .venv/bin/gemelo
"""
PROCESS_COMPOSE = """#!/bin/sh
[ "$1" = version ] && echo "Version:        {version}"
exit 0
"""
GO = """#!/bin/sh
case $1 in version) echo go version go1.26.0 linux/amd64; exit 0 ;; esac
{body}
while [ "$1" != -o ]; do shift; done
mkdir -p "$(dirname "$2")"
printf '#!/bin/sh\\nexit 0\\n' > "$2"
chmod +x "$2"
"""


def heed_hang_ups() -> None:
    """As a terminal starts it: tests that run under nohup ignore SIGHUP, and so would a shell that they start."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


class Machine:
    """A project folder and a PATH with the common tools and nothing else."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "mi proyecto ñ"
        self.bin = folder / "bin"
        self.home = folder / "home"
        for each in (self.root, self.bin, self.home):
            each.mkdir()
        source = project_root()
        shutil.copytree(source / "deploy", self.root / "deploy")
        for name in ("pyproject.toml", "requirements.lock", "process-compose.yaml"):
            shutil.copy(source / name, self.root)
        for name in COMMON.split():
            self.link(name)
        self.write(
            self.root / "firmware/bindings/build.sh", "mkdir -p firmware/build; touch firmware/build/libgemelo_core.so"
        )
        self.write(self.root / "services/planner/native/build.sh", "exit 0")
        self.write(self.root / "schemas/reasons/languages/en/goal.po", "")
        self.write(
            self.root / "schemas/reasons/compiled.py",
            "import pathlib, sys; pathlib.Path(sys.argv[1], 'en', 'gemelo.mo').touch()",
        )
        self.write(self.root / "services/broker/native/main.go", "package main")

    def link(self, name: str) -> None:
        """Gives the machine this machine's own `name`."""
        found = shutil.which(name)
        assert found is not None, f"{name} is not on this machine"
        (self.bin / name).symlink_to(found)

    def program(self, name: str, text: str) -> None:
        """Gives the machine a program of the test's own."""
        self.write(self.bin / name, text)

    def write(self, path: Path, text: str) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    def begin(self, **environ: str) -> subprocess.Popen[str]:
        """A bootstrap in a process group of its own, as a terminal gives it."""
        return subprocess.Popen(
            [self.bin / "bash", "deploy/bootstrap"],
            cwd=self.root,
            env={"PATH": str(self.bin), "HOME": str(self.home), "LC_ALL": "C", **environ},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=heed_hang_ups,
        )

    def bootstrap(self, **environ: str) -> subprocess.CompletedProcess[str]:
        process = self.begin(**environ)
        try:
            stdout, stderr = process.communicate(timeout=60)
        finally:
            process.kill()
        return subprocess.CompletedProcess(process.args, process.returncode, stdout, stderr)

    def complete(self) -> None:
        """Everything that the bootstrap looks for, faked so that nothing is fetched or built."""
        (self.bin / "python3").symlink_to(Path(sys.executable).resolve())
        self.program("uv", UV)
        self.program("c++", "#!/bin/sh\nexit 0\n")
        self.program("go", GO.format(body=""))
        self.program("process-compose", PROCESS_COMPOSE.format(version="v1.85.0"))


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)
