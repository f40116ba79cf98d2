"""`make demo`: starts a stack of its own, performs, stops it, and leaves figures, a recording and a picture.

Leaves out/demo.json (the figures), out/demo.rrd (for `rerun`), out/demo.png, and in out/demo/ the MCAP, the command
CSV and the logs. Exit code 0 only if every move succeeded and every figure holds. How each figure is measured stands
in `ledger` and `report`; times are those of the planner (`plan_ms`) and of the gateway (`took`).
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

import msgspec

import gemelo
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.process.ending import ended_by_signals
from gemelo.schemas.plain_text import of_environment
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.language import choose, sentence
from gemelo.tools.demo.performance import Performance
from gemelo.tools.demo.report import complaints, report_of, text_of
from gemelo.tools.stack.results import new_results
from gemelo.tools.stack.stack import Stack, StackError

DRIVER = "sudo apt-get install mesa-vulkan-drivers libvulkan1"
MOSQUITTO = (shutil.which("mosquitto"), shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin"))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="make demo", description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--out", type=Path, default=project_root() / "out", help="folder of the results")
    parser.add_argument("--broker", choices=("embedded", "mosquitto"), default=None)
    parser.add_argument("--no-picture", action="store_true", help="leave out the PNG")
    options = parser.parse_args()
    choose(of_environment(os.environ))
    try:
        with ended_by_signals():
            sys.exit(demonstrate(options.out.resolve(), options.broker or best_broker(), not options.no_picture))
    except KeyboardInterrupt:
        sys.exit(f"demo: {sentence(because('demo.ended'))}")
    except StackError as error:
        sys.exit(f"demo: {sentence(error.reason)}")


def best_broker() -> str:
    """mosquitto if it is installed, as real arms use it; else the embedded one."""
    return "mosquitto" if any(MOSQUITTO) else "embedded"


def demonstrate(out: Path, broker: str, with_picture: bool) -> int:
    """Runs the demonstration on a stack of its own and writes the results into `out`; returns the exit code."""
    folder, recording = new_results(out / "demo"), out / "demo.rrd"
    for old in (out / "demo.json", recording, out / "demo.png"):
        old.unlink(missing_ok=True)
    robot = load_deployment().robot
    environment = {"GEMELO_CONFIG": str(write_deployment(folder / "deployment.toml", robot, recording))}
    say(because("demo.starting", broker=broker))
    with Stack(broker=broker, viewer="none", out=folder, environment=environment) as stack:
        say(because("demo.ready", time=stack.ready_seconds))
        os.environ.update(stack.deployment)  # where the arm is found
        with gemelo.connect(name="demo") as arm:
            performance = Performance(arm, say)
            performance.run()
    say(because("demo.stopped"))
    report = report_of(arm.name, performance.moves, performance.ledger)
    (out / "demo.json").write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    found = complaints(report, performance.ledger)
    found += missing_files(folder, recording)
    if with_picture:
        found += take_picture(recording, out / "demo.png")
    results, png = because("demo.results", file=str(out / "demo.json"), folder=str(folder)), out / "demo.png"
    view = because("demo.view", recording=str(recording))
    if png.exists():
        view = because("demo.view.picture", recording=str(recording), picture=str(png))
    print(f"\n{text_of(report, performance.moves)}\n\n{sentence(results)}\n{sentence(view)}")
    for complaint in found:
        print(sentence(because("demo.failed", complaint)), file=sys.stderr)
    return 1 if found else 0


def say(reason: Reason) -> None:
    """A line of progress."""
    print(f"demo: {sentence(reason)}", flush=True)


def write_deployment(path: Path, robot: str, recording: Path) -> Path:
    """A deployment file that has the visualizer write the recording; ports come from the environment."""
    path.write_text(f"robot = {_toml(robot)}\n\n[parameters.visualizer]\nrecording_path = {_toml(str(recording))}\n")
    return path


def _toml(text: str) -> str:
    return msgspec.json.encode(text).decode()


def missing_files(folder: Path, recording: Path) -> list[Reason]:
    """Recordings that logger and visualizer have not left."""
    missing = [
        because("demo.no_recording", kind=pattern[2:], folder=str(folder))
        for pattern in ("*.mcap", "*.csv")
        if not any(folder.rglob(pattern))
    ]
    if not recording.exists():
        missing.append(because("demo.no_view", file=recording.name))
    return missing


def take_picture(recording: Path, png: Path) -> list[Reason]:
    """Takes a picture of the viewer; returns what went wrong, empty if nothing did.

    Where no driver draws it there is none: that is said with its remedy, and fails nothing.
    """
    from gemelo.services.visualizer.program.screenshot import NoGraphics, save_screenshot  # slow to load: rerun

    try:
        save_screenshot(recording, png)
    except NoGraphics as error:
        say(because("demo.picture.none", error=missing_driver() or f"{error}: {DRIVER}"))
        return []
    except (RuntimeError, OSError) as error:
        if lack := missing_driver():
            say(because("demo.picture.none", error=lack))
            return []
        return [because("demo.picture.failed", error=str(error))]
    return []


def missing_driver() -> str:
    """What is missing to draw without a display, with the remedy; empty where all is here."""
    command = [str(project_root() / "deploy/optional"), "vulkan"]
    asked: subprocess.CompletedProcess[str] = subprocess.run(command, capture_output=True, text=True, check=False)
    return asked.stdout.strip()


if __name__ == "__main__":
    main()
