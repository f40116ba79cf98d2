"""`gemelo broker secure`: a broker with users, an ACL and TLS, and a board that is told of it."""

from __future__ import annotations

import os
from pathlib import Path

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import AUTHORITY
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.device.provision import BAUD, PASSWORDS, provision
from gemelo.tools.cli.hosts.credentials import WIFI_PASSWORD, CredentialsChange, certificate, password, require_sound
from gemelo.tools.cli.parser import Options, Parser, positive_integer

FOLDER = ".gemelo/broker"
PLAIN_PORT, TLS_PORT = 1883, 8883
LOOPBACK = ("localhost", "127.0.0.1")


def add_options(parser: Parser) -> None:
    """Adds names, folder, and what a board is provisioned with."""
    parser.add_argument(
        "--host", nargs="+", metavar="NAME", help="names and IP addresses of the broker, the board's first [mqtt.host]"
    )
    parser.add_argument("--port", type=positive_integer, metavar="PORT", help="of TLS [mqtt.port, 8883 for 1883]")
    parser.add_argument(
        "--device", nargs="+", metavar="NAME", help="of [device] in robot.toml [that of the deployment]"
    )
    parser.add_argument("--folder", type=Path, metavar="FOLDER", help=f"where its files go [{FOLDER}]")
    parser.add_argument("--serial", metavar="PORT", help="tell the board at this line, as /dev/ttyUSB0")
    parser.add_argument("--baud", type=positive_integer, default=BAUD, metavar="BAUD", help="921600 if not said")
    parser.add_argument("--wifi-ssid", metavar="NAME", help="the board's network; its password is asked for")
    parser.epilog = (
        f"Again it keeps authority and passwords, and renews the certificate.\n{PASSWORDS}\n\n{parser.epilog}"
    )


def run(options: Options) -> ExitCode:
    """Writes the folder, says what to do with it, and provisions the board if there is one."""
    deployment = load_started()
    devices = options.device or [load_arm(project_root() / deployment.robot).device.name]
    if options.serial and len(devices) != 1:
        raise usage(because("provision.one_board", count=len(devices)))
    if options.wifi_ssid and not options.serial:
        raise usage(because("provision.serial_too"))
    folder = _folder(options, deployment)
    hosts = tuple(options.host or [deployment.mqtt.host])
    port = options.port or (TLS_PORT if deployment.mqtt.port == PLAIN_PORT else deployment.mqtt.port)
    try:
        known = secure_folder.make(folder, (*hosts, *LOOPBACK), devices)
        print(summary(folder, hosts, port, known), flush=True)
        if options.serial is None:
            return ExitCode.OK
        credentials = credentials_of(folder, devices[0], f"mqtts://{hosts[0]}:{port}", options.wifi_ssid)
    except AccessError as error:
        raise CommandError(error) from error
    return provision(options.serial, options.baud, require_sound(credentials))


def _folder(options: Options, deployment: Deployment) -> Path:
    if options.folder is not None:
        return Path(options.folder).absolute()
    return Path(deployment.mqtt.secure_folder or project_root() / FOLDER)


def credentials_of(folder: Path, device: str, uri: str, wifi: str | None = None) -> CredentialsChange:
    """What a board needs to join the broker at `uri`; raises `AccessError`."""
    return CredentialsChange(
        device=device,
        wifi_ssid=wifi,
        wifi_password=None if wifi is None else password("wifi", WIFI_PASSWORD, os.environ),
        mqtt_uri=uri,
        mqtt_user=device,
        mqtt_password=secure_folder.password_of(folder, device),
        mqtt_ca=certificate(folder / AUTHORITY),
    )


def summary(folder: Path, hosts: tuple[str, ...], port: int, devices: tuple[str, ...]) -> str:
    """What was made, without a secret, and the lines of the deployment that use it."""
    root = project_root()
    said = folder.relative_to(root) if folder.is_relative_to(root) else folder
    made = because("broker.secure.made", folder=str(said), hosts=", ".join(hosts), devices=", ".join(devices))
    lines = [
        sentence(made),
        sentence(because("broker.secure.deployment")),
        "  [mqtt]",
        f'  broker = "embedded" # {sentence(because("broker.secure.kind"))}',
        f'  host = "{hosts[0]}"',
        f"  port = {port}",
        f'  secure_folder = "{said}"',
        sentence(because("broker.secure.listener")),
        *(f"  {line}" for line in (f"listener {port}\n{secure_folder.listener(folder)}").splitlines()),
    ]
    if hosts[0] in LOOPBACK:
        lines.append(sentence(because("broker.secure.loopback")))
    return "\n".join(lines)
