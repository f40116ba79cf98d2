"""The options of `gemelo replay`; imports nothing, so that the command line shows them at once."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

SERVICES = ("planner", "stepper_gateway", "state_publisher")


def add_options(parser: ArgumentParser) -> None:
    """The recording, the service, and how it is said."""
    parser.add_argument("file", metavar="FILE", type=Path, help="a recording, as out/recordings/....mcap")
    parser.add_argument("service", metavar="SERVICE", choices=SERVICES, help=", ".join(SERVICES))
    parser.add_argument("--robot", type=Path, metavar="FOLDER", help="the robot's folder [as it was recorded]")
    said = "share by which a float may differ, for a recording of another processor [0: the same to the byte]"
    parser.add_argument("--tolerance", type=float, default=0.0, metavar="SHARE", help=said)
    parser.add_argument("--json", action="store_true", help="machine-readable output")
