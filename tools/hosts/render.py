"""Everything that a host of a site needs, as files."""

from __future__ import annotations

import json
from pathlib import Path

from gemelo.libraries.mqtt.secure_folder import lines, mosquitto_conf
from gemelo.libraries.runtime.bus.zenoh_config import locked_router
from gemelo.libraries.runtime.permissions import access_control
from gemelo.schemas.site import Site
from gemelo.tools.hosts import deployments
from gemelo.tools.hosts.containers import compose, containerfile, process_compose
from gemelo.tools.hosts.firewall import FILE, firewall, ports
from gemelo.tools.hosts.layout import listening, principals, robots
from gemelo.tools.hosts.units import units

OF_A_PLACE = ("router.json5", "mosquitto.conf", FILE)  # of a host where router or broker run


def rendered(site: Site, host: str) -> dict[str, str]:
    """The files of a host by path, relative to its folder; none of them holds a secret."""
    files = {f"{robot}.toml": deployments.deployment_of_robot(site, host, robot) for robot in robots(site, host)}
    if host in (site.router.host, site.broker.host):
        files[f"{deployments.HOST}.toml"] = deployments.deployment_of_host(site, host)
    if host == site.router.host:
        files["router.json5"] = router(site)
    if host == site.broker.host:
        files["mosquitto.conf"] = mosquitto(site)
    if ports(site, host):
        files[FILE] = firewall(site, host)
    files |= {f"systemd/{name}": text for name, text in units(site, host).items()}
    return files | {
        "process-compose.yaml": process_compose(site, host),
        "compose.yaml": compose(site, host),
        "Containerfile": containerfile(site, host),
    }


def write(site: Site, host: str, folder: Path) -> tuple[Path, ...]:
    """Writes the files of a host into `folder`, and returns them; those of what has left it go."""
    files, written = rendered(site, host), []
    for file in (*folder.glob("*"), *folder.glob("systemd/*")):
        name = str(file.relative_to(folder))
        if name not in files and (file.parent != folder or name in OF_A_PLACE or _is_deployment(file)):
            file.unlink()
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        written.append(path)
    return tuple(written)


def outdated(site: Site, host: str, folder: Path) -> str:
    """The first file in the folder of a host that is not what the site's file says now; empty where all are."""
    for name, text in rendered(site, host).items():
        if not (folder / name).is_file() or (folder / name).read_text(encoding="utf-8") != text:
            return name
    return ""


def _is_deployment(file: Path) -> bool:
    """True for a robot's file of a former render, and false for any that a person has put there."""
    return file.suffix == ".toml" and file.read_text(encoding="utf-8").startswith(deployments.WRITTEN)


def router(site: Site) -> str:
    """The router's json5, for gemelo-router and for zenohd: addresses, TLS, and the permissions of every role."""
    folder = deployments.keys(site)
    files = (f"{folder}/ca.pem", f"{folder}/router.pem", f"{folder}/router.key")
    address = listening(site, site.router.host)
    return (
        json.dumps(
            locked_router(address, site.router.port, *files, access_control(site.robots, principals(site))), indent=1
        )
        + "\n"
    )


def mosquitto(site: Site) -> str:
    """mosquitto.conf, as gemelo-broker writes it too: TLS, users and an ACL."""
    door = lines(Path(deployments.broker_folder(site)))
    return mosquitto_conf(listening(site, site.broker.host), site.broker.port, door)
