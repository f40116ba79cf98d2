"""`gemelo-router` of a site of one host, with the keys that `gemelo deploy keys` has made for it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from gemelo.libraries.runtime.bus.zenoh_config import locked_router
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.permissions import access_control
from gemelo.schemas.deployment import RouterSection
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.hosts.keys import make_keys
from gemelo.tools.hosts.layout import principals
from tests.runtime.locks import HOST
from tests.runtime.support import RouterProcess, free_port

SITE = """
certificate_days = {days}
[router]
host = "one"
port = {port}
[broker]
host = "one"
port = {broker}
[robots.rm1]
folder = "urdf/rm1"
device = "board"
[hosts.one]
address = "127.0.0.1"
roles = ["operator", "viewer"]
[hosts.one.services]
rm1 = ["stepper_gateway", "state_publisher"]
"""


class SiteRouter(RouterProcess):
    """The site is `lab`; its keys are made, or are those below `keys`."""

    def __init__(self, folder: Path, keys: Path | None = None, days: int = 365) -> None:
        folder.mkdir(exist_ok=True)
        self.folder, self.out = folder, folder / "out"
        self.home = self.out / "deploy/lab"
        self.keys = self.home / "one/keys"
        self.site_file, self._configuration = folder / "lab.toml", folder / "router.json5"
        self._days, self._given = days, keys
        super().__init__(folder)

    def start(self) -> None:
        text = SITE.format(days=self._days, port=self.port, broker=free_port())
        self.site_file.write_text(text)
        self.site = load_site(self.site_file, project_root())
        if self._given is None:
            self.made = make_keys(self.site, self.home, project_root())
        else:
            shutil.copytree(self._given, self.home)
        files = (str(self.keys / name) for name in ("ca.pem", "router.pem", "router.key"))
        configuration = locked_router(HOST, self.port, *files, access_control(self.site.robots, principals(self.site)))
        self._configuration.write_text(json.dumps(configuration))
        self.environ["GEMELO_ROUTER_CONFIGURATION"] = str(self._configuration)
        super().start()

    def section(self, role: str, keys: Path | None = None) -> RouterSection:
        """How a session with the certificate of a role joins, by the files of `keys`, else of this host."""
        folder = keys or self.keys
        ca, certificate, key = (str(folder / name) for name in ("ca.pem", f"{role}.pem", f"{role}.key"))
        return RouterSection(port=self.port, tls=True, ca=ca, certificate=certificate, key=key)
