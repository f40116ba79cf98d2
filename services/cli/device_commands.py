"""Commands about the controller board: `gemelo device ...`."""

from __future__ import annotations

import os
from pathlib import Path

from services.cli.exits import ExitCode, usage
from services.cli.parser import Command, Options, Parser, Words, json_option, positive_integer, positive_number

GROUPS = {"device": "the controller board: how it is, what it is told, and its drivers"}


def device_status(options: Options) -> ExitCode:
    from services.cli.device_status import status
    from services.cli.session import connect

    with connect() as session:
        return status(session, options.json)


def monitor_options(parser: Parser) -> None:
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N lines")
    parser.add_argument("-d", "--duration", type=positive_number, metavar="SECONDS", help="end after so long")
    json_option(parser)


def device_monitor(options: Options) -> ExitCode:
    from services.cli.device_monitor import monitor
    from services.cli.session import connect

    with connect() as session:
        return monitor(session, options.count, options.duration, options.json)


def config_options(parser: Parser) -> None:
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--show", action="store_true", help="what robot.toml asks for, and whether it is in force")
    what.add_argument("--push", action="store_true", help="disarm, give the device its configuration, arm again")
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask before the drivers go off")
    json_option(parser)


def device_config(options: Options) -> ExitCode:
    from services.cli.device_config import push, show
    from services.cli.session import connect

    with connect() as session:
        return push(session, options.yes) if options.push else show(session, options.json)


def device_arm(options: Options) -> ExitCode:
    from services.cli.device import command
    from services.cli.session import connect

    with connect() as session:
        return command(session, options.command.words[1])


def press_options(parser: Parser) -> None:
    from services.cli.device_press import listing

    parser.add_argument("what", metavar="WHAT", help="see below")
    parser.add_argument("rest", metavar="VALUE", nargs="*", default=[], help="what it is done to, and how much")
    parser.epilog = f"what:\n{listing()}\n\n{parser.epilog}"


def device_press(options: Options) -> ExitCode:
    from services.cli.device_press import press, request_of
    from services.cli.session import connect, load

    request_of(load()[1], options.what, options.rest)
    with connect() as session:
        return press(session, options.what, options.rest)


PASSWORDS = """Passwords are no arguments, because every user of a machine sees those: they are asked for, or taken from
$GEMELO_WIFI_PASSWORD and $GEMELO_MQTT_PASSWORD, or read as lines of standard input, in this order."""


def provision_options(parser: Parser) -> None:
    parser.add_argument("--serial", required=True, metavar="PORT", help="as /dev/ttyUSB0")
    parser.add_argument("--baud", type=positive_integer, default=921_600, metavar="BAUD", help="921600 if not said")
    parser.add_argument("--device", metavar="NAME", help="its name: that of [device] in robot.toml")
    parser.add_argument("--wifi-ssid", metavar="NAME", help="the network; its password is asked for")
    parser.add_argument("--mqtt-uri", metavar="URI", help="as mqtt://host:1883, or mqtts://host:8883")
    parser.add_argument("--mqtt-user", metavar="NAME", help="at the broker; its password is asked for")
    parser.add_argument("--mqtt-ca", type=Path, metavar="FILE", help="the certificate that mqtts trusts, PEM")
    parser.add_argument("--factory-reset", action="store_true", help="forget everything, configuration included")
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask before a factory reset")
    parser.epilog = f"{PASSWORDS}\n\n{parser.epilog}"


def device_provision(options: Options) -> ExitCode:
    from services.cli import credentials as told
    from services.cli.confirm import confirm
    from services.cli.provision import provision

    given = (options.device, options.wifi_ssid, options.mqtt_uri, options.mqtt_user, options.mqtt_ca)
    if options.factory_reset:
        if any(each is not None for each in given):
            raise usage("--factory-reset forgets everything: tell the device anew afterwards, in a command of its own")
        confirm(f"The device at {options.serial} forgets its networks, passwords and configuration.", options.yes)
        return provision(options.serial, options.baud, told.Credentials(factory_reset=True))
    wifi, mqtt = options.wifi_ssid, options.mqtt_user
    credentials = told.Credentials(
        device=options.device,
        wifi_ssid=wifi,
        mqtt_uri=options.mqtt_uri,
        mqtt_user=mqtt,
        mqtt_ca=told.certificate(options.mqtt_ca),
        wifi_password=None if wifi is None else told.password("Wi-Fi password", told.WIFI_PASSWORD, os.environ),
        mqtt_password=None if mqtt is None else told.password("MQTT password", told.MQTT_PASSWORD, os.environ),
    )
    return provision(options.serial, options.baud, told.require_sound(credentials))


def press_words() -> Words:
    from services.cli.device_words import presses

    return presses()


COMMANDS = (
    Command(("device", "status"), "who the device is, its mode, faults, switches, outputs and sensors", device_status,
            json_option, "gemelo device status"),
    Command(("device", "monitor"), "a line for everything that changes, until Ctrl-C", device_monitor, monitor_options,
            "gemelo device monitor --duration 10"),
    Command(("device", "config"), "what the device is told of the arm, and telling it anew", device_config,
            config_options, "gemelo device config --push"),
    Command(("device", "arm"), "energise the drivers", device_arm, example="gemelo device arm"),
    Command(("device", "disarm"), "take the current from the motors; every joint is unreferenced then", device_arm,
            example="gemelo device disarm"),
    Command(("device", "press"), "press a virtual device's buttons, push its shafts, break its network", device_press,
            press_options, "gemelo device press slip brazo_joint 100", press_words),
    Command(("device", "provision"), "tell a board its networks over its serial line", device_provision,
            provision_options,
            "gemelo device provision --serial /dev/ttyUSB0 --device rm1 --wifi-ssid lab --mqtt-uri mqtt://10.0.0.2:1883"),
)  # fmt: skip
