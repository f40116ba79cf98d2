"""systemd's units: a user of their own, no privileges, a watchdog that each process feeds while its loop runs."""

from __future__ import annotations

from gemelo.libraries.runtime.process.priority import AHEAD
from gemelo.schemas.deployment import Wire
from gemelo.schemas.site import Site
from gemelo.tools.hosts import firewall
from gemelo.tools.hosts.deployments import environment
from gemelo.tools.hosts.firewall import FILE, UNIT_NAME, ports
from gemelo.tools.hosts.layout import FILES, TASKS, Process, processes
from gemelo.tools.hosts.quoting import systemd

TARGET = "gemelo.target"
UNIT = """\
# Written by `gemelo deploy render {site} {host}`.
[Unit]
Description={description}
Wants=network-online.target
After=network-online.target
PartOf={target}
# Started again for as long as it takes: an address or a port that is not there yet may come.
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=all
User={user}
{environment}
ExecStart={command}
# Ready when its state is valid, however long that takes: a board may be off. Until then its loop extends the start
# (EXTEND_TIMEOUT_USEC), from then on it feeds the watchdog: one that freezes is started again.
TimeoutStartSec=90
WatchdogSec=5
Restart=always
RestartSec=1
TimeoutStopSec=5

MemoryMax={memory}
TasksMax={tasks}
LimitNOFILE={files}
LimitCORE=0
UMask=0077
NoNewPrivileges=yes
CapabilityBoundingSet=
AmbientCapabilities=
ProtectSystem=strict
ProtectHome=read-only
ReadWritePaths={state}
PrivateTmp=yes
{devices}
ProtectClock=yes
ProtectControlGroups=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX
RestrictNamespaces=yes
{realtime}
RestrictSUIDSGID=yes
LockPersonality=yes
SystemCallArchitectures=native

[Install]
WantedBy={target}
"""
WHOLE = """\
# Written by `gemelo deploy render {site} {host}`: `systemctl start gemelo.target` starts all of this host.
[Unit]
Description=gemelo on {host}
# Reached when all is started, not when all is ready: that may wait for another host, and nobody's boot waits for it.
DefaultDependencies=no
Conflicts=shutdown.target
Before=shutdown.target
Wants={units}

[Install]
WantedBy=multi-user.target
"""


def units(site: Site, host: str) -> dict[str, str]:
    """The files of /etc/systemd/system by name."""
    files = {f"{process.unit}.service": _unit(site, host, process) for process in processes(site, host)}
    if ports(site, host):
        text = firewall.UNIT.format(site=site.name, host=host, target=TARGET, file=systemd(f"{site.config}/{FILE}"))
        files[UNIT_NAME] = text
    return files | {TARGET: WHOLE.format(site=site.name, host=host, units=" ".join(files))}


def _unit(site: Site, host: str, process: Process) -> str:
    service = process.service
    variables = environment(site, process).items()
    return UNIT.format(
        site=site.name,
        host=host,
        target=TARGET,
        description=f"gemelo: {service.about}{f' ({process.robot})' if process.robot else ''}",
        user=site.user,
        environment="\n".join(f"Environment={systemd(f'{name}={value}')}" for name, value in variables),
        # ":" keeps systemd from looking for variables in the words.
        command=f":{systemd(f'{site.project}/.venv/bin/{process.program}')}",
        memory=service.memory,
        tasks=TASKS,
        files=FILES,
        state=systemd(site.state),
        devices=_devices(site, process),
        realtime=f"LimitRTPRIO={AHEAD}" if service.is_ahead else "RestrictRealtime=yes",
    )


def _devices(site: Site, process: Process) -> str:
    """Only a gateway on a serial line and a camera see devices; of them their user may open what the group may."""
    settings, name = site.robots.get(process.robot), process.service.name
    if name == "stepper_gateway" and settings is not None and settings.wire is Wire.SERIAL:
        group = "dialout"
    elif name == "camera":
        group = "video"
    else:
        return "PrivateDevices=yes"
    # A device by its path would be looked up once, at the start: what is plugged in later would be refused.
    return f"DevicePolicy=closed\nDeviceAllow=char-* rw\nSupplementaryGroups={group}"
