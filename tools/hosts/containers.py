"""The same processes without systemd: a process-compose file, and a compose file with one Containerfile."""

from __future__ import annotations

import json
import shlex
from typing import Any

from gemelo.schemas.deployment import Wire
from gemelo.schemas.site import Site
from gemelo.tools.hosts.deployments import HOST, environment
from gemelo.tools.hosts.layout import FILES, TASKS, Process, extras, processes

IN_IMAGE = "/opt/gemelo"  # where the Containerfile puts the project
CONTAINERFILE = """\
# Written by `gemelo deploy render {site} {host}`. Build it in the project's folder, on the host itself, as root:
# podman build --build-arg UID=$(id -u {user}) -t gemelo -f <this file> .
FROM docker.io/library/debian:12-slim AS build
RUN apt-get update \\
    && apt-get install -y --no-install-recommends ca-certificates curl g++ python3 python3-dev python3-venv xz-utils
COPY . /opt/gemelo
# Compiled here, as no process can write there later; without what only building needs.
RUN cd /opt/gemelo \\
    && EXTRAS="{extras}" SUPERVISOR=none deploy/bootstrap \\
    && .venv/bin/python -m compileall -q -j 0 .venv/lib gemelo schemas services firmware \\
    && rm -rf .gemelo \\
    && chmod -R a+rX .

FROM docker.io/library/debian:12-slim
RUN apt-get update \\
    && apt-get install -y --no-install-recommends ca-certificates libgomp1 mosquitto python3 \\
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /opt/gemelo /opt/gemelo
# Keys and state are this user's alone, and without capabilities root cannot read them either.
ARG UID
RUN useradd --no-create-home --home-dir /nonexistent --uid "${{UID:?is missing: --build-arg UID=...}}" {user}
USER {user}
"""


def containerfile(site: Site, host: str) -> str:
    """An image of the project with what this host runs, for compose.yaml."""
    return CONTAINERFILE.format(site=site.name, host=host, user=site.user, extras=" ".join(extras(site, host)))


def process_compose(site: Site, host: str) -> str:
    """process-compose.yaml of a host, as JSON, which YAML contains."""
    made = {process.unit: _supervised(site, process) for process in processes(site, host)}
    return _text({"version": "0.5", "name": f"gemelo-{host}", "is_strict": True, "processes": made})


def compose(site: Site, host: str) -> str:
    """compose.yaml of a host, as JSON: the host's network, no capabilities, nothing written but the state."""
    made = {process.unit: _contained(site, process) for process in processes(site, host)}
    return _text({"name": f"gemelo-{host}", "services": made})


def _supervised(site: Site, process: Process) -> dict[str, Any]:
    program = shlex.quote(f"{site.project}/.venv/bin/{process.program}")
    return {
        "description": process.service.about,
        "command": f"exec {program} 2>&1",
        "environment": [f"{name}={value}" for name, value in environment(site, process).items()],
        "availability": {"restart": "always", "backoff_seconds": 1},
        "shutdown": {"signal": 15, "timeout_seconds": 5},
        "readiness_probe": {
            "period_seconds": 1,
            "timeout_seconds": 2,
            "failure_threshold": 1_000_000_000,
            "exec": {"command": _probe(site, process, site.project)},
        },
    }


def _contained(site: Site, process: Process) -> dict[str, Any]:
    settings = site.robots.get(process.robot)
    has_line = settings is not None and settings.wire is Wire.SERIAL and process.service.name == "stepper_gateway"
    return {
        "image": "gemelo",
        "command": [f"{IN_IMAGE}/.venv/bin/{process.program}"],
        "environment": environment(site, process),
        "network_mode": "host",
        "restart": "always",
        "init": True,
        "read_only": True,
        "cap_drop": ["ALL"],
        "security_opt": ["no-new-privileges:true"],
        "mem_limit": process.service.memory.lower(),
        "pids_limit": TASKS,
        "ulimits": {"nofile": FILES, "core": 0},
        "tmpfs": ["/tmp"],
        "volumes": [_mount(site.config, is_read_only=True), _mount(site.state, is_read_only=False)],
        **(_line(settings.serial) if settings and has_line else {}),
        "healthcheck": {"test": ["CMD-SHELL", _probe(site, process, IN_IMAGE)], "interval": "5s"},
    }


def _line(device: str) -> dict[str, Any]:
    """A serial line, for a user who is no root."""
    # podman-compose knows only the short form, in which ":" cannot be part of a path.
    mapped = {"source": device, "target": device} if ":" in device else f"{device}:{device}"
    return {"devices": [mapped], "group_add": ["dialout"]}


def _mount(path: str, is_read_only: bool) -> dict[str, Any]:
    return {"type": "bind", "source": path, "target": path, "read_only": is_read_only}


def _probe(site: Site, process: Process, project: str) -> str:
    """A line of shell that succeeds while the process says that it is ready, and ends it where it stands still."""
    run = shlex.quote(f"{site.state}/{process.robot or HOST}/run")
    return f"GEMELO_PATHS_RUN={run} {shlex.quote(f'{project}/deploy/probe')} {process.service.name} restart"


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"
