"""Installation of a host's folder over ssh as root, as commands that can be shown before they are run."""

from __future__ import annotations

import ipaddress
import shlex
import subprocess
from pathlib import Path, PurePosixPath

from gemelo.schemas.reasons import because
from gemelo.schemas.site import Site
from gemelo.tools.hosts.firewall import UNIT_NAME, ports
from gemelo.tools.hosts.layout import robots
from gemelo.tools.hosts.site_file import SiteError
from gemelo.tools.hosts.units import TARGET

Command = tuple[str, ...]
# Keys of roles and units of services that have left a host go from it; all else that stands there stays.
KEPT = ("--filter=risk /systemd/gemelo-*.service",
        *(f"--filter=protect {each}" for each in ("/*", "/systemd/***", "/broker/***")))  # fmt: skip
MADE_BY = {"systemd": "gemelo deploy render", "keys": "gemelo deploy keys"}  # folders of a host


def commands(site: Site, host: str, folder: Path) -> tuple[Command, ...]:
    """What is run on this machine; services that run already are not restarted, as an arm may move.

    Those that the site does not have on this host any more are stopped: another host may run them now.

    `folder` is the host's own; raises `SiteError` where something of it was not made yet.
    """
    for name, maker in MADE_BY.items():
        if not (folder / name).is_dir():
            raise SiteError(
                because("site.install.missing", folder=str(folder), name=name, maker=f"{maker} {site.name}")
            )
    address = site.hosts[host].address
    config, state, user = shlex.quote(site.config), shlex.quote(site.state), site.user
    prepare = (
        f"id -u {user} >/dev/null 2>&1 || useradd --system --home-dir {state} {user}; "
        f"install -d -m 700 -o {user} {config} {state}"
    )
    start = (
        f'cd /etc/systemd/system && for unit in gemelo-*.service; do [ -e {config}/systemd/"$unit" ] || '
        f"! grep -qs '^# Written by .gemelo deploy render {site.name} ' \"$unit\" || "
        f'{{ systemctl stop "$unit" && rm "$unit"; }} || exit 1; done; '
        f"install -m 644 {config}/systemd/* /etc/systemd/system/ && systemctl daemon-reload "
        f"&& systemctl enable --now {TARGET}" + (f" && systemctl restart {UNIT_NAME}" if ports(site, host) else "")
    )
    return (
        ("ssh", f"root@{address}", prepare),
        ("ssh", f"root@{address}", _look(site, host)),
        ("rsync", "--archive", "--protect-args", "--delete", *KEPT, "--chmod=go=", f"--chown={user}:", f"{folder}/",
         f"root@{_bracketed(address)}:{site.config}/"),
        ("ssh", f"root@{address}", start),
    )  # fmt: skip


def _look(site: Site, host: str) -> str:
    """Ends with 1 and a sentence where the services could not be started, or files not be copied."""
    program = f"{site.project}/.venv/bin/gemelo"
    remedy = f"`make setup` in {site.project} there, with a Python that everybody may run"
    wanted = {
        f"runuser -u {site.user} -- {shlex.quote(program)} --help >/dev/null":
            f"{site.user} cannot run {program} on {host}: {remedy}",
        "command -v rsync >/dev/null": f"rsync is missing on {host}: apt-get install rsync",
    }  # fmt: skip
    if ports(site, host):
        wanted["command -v nft >/dev/null"] = f"nft is missing on {host}: apt-get install nftables"
    for robot in robots(site, host):
        for file in filter(None, (f"{site.robots[robot].folder}/robot.toml", site.robots[robot].cell)):
            there, target = f"{site.project}/{file}", f"root@{_bracketed(site.hosts[host].address)}:{site.project}/"
            copied = f"rsync -a --relative {shlex.quote(str(PurePosixPath(file).parent))} {shlex.quote(target)}"
            wanted[f"runuser -u {site.user} -- test -r {shlex.quote(there)}"] = (
                f"{site.user} cannot read {there} on {host}: `{copied}` in the project's folder here"
            )
    return "; ".join(f"{there} || {{ echo {shlex.quote(said)} >&2; exit 1; }}" for there, said in wanted.items())


def run(wanted: tuple[Command, ...]) -> None:
    """Runs them in order; raises `SiteError` with the first that fails, after which nothing more is done."""
    for command in wanted:
        try:
            code = subprocess.run(command, check=False).returncode
        except FileNotFoundError:
            raise SiteError(because("site.install.command", command=command[0])) from None
        if code:
            raise SiteError(because("site.install.ended", code=code, command=shlex.join(command)))


def _bracketed(address: str) -> str:
    try:
        return f"[{address}]" if ipaddress.ip_address(address).version == 6 else address
    except ValueError:
        return address
