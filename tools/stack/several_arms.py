"""`python -m gemelo.tools.stack.several_arms "NAME ..."`: what `make up ARMS="rm1 parol6"` starts, as files.

Prints the path of a process-compose file: router, broker and viewer once, and every other process of
process-compose.yaml once for each arm, named <robot>-<process>. What cannot run together is refused before anything is
written.
"""

from __future__ import annotations

import json
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from gemelo.libraries.runtime.deployment import forget_arms, load_deployment, overriding, project_root
from gemelo.libraries.runtime.started import keep_started
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.plain_text import of_environment
from gemelo.schemas.reasons import because, say
from gemelo.tools.stack.arms import SHARED, StackedArm, deployment_file, file_of, left_out, stacked_arms
from gemelo.tools.stack.start_check import say_virtual, start_problems, without_doubles

ABOUT = "about"
OUT = "${GEMELO_PATHS_OUT:-out}"  # as process-compose.yaml writes it
Process = dict[str, Any]


def compose_of(
    single: Mapping[str, Any], arms: Sequence[StackedArm], common: Deployment, environ: Mapping[str, str]
) -> Process:
    """`single` is the content of process-compose.yaml; returns that of the file for `arms`."""
    processes: dict[str, Process] = {}
    for name in (each for each in SHARED if each not in left_out(common)):
        processes[name] = _placed(single["processes"][name], common.paths.out)
    for each in arms:
        processes |= _of_arm(single["processes"], each, common, environ)
    about = single["processes"][ABOUT]
    said = " ".join(shlex.quote(f"{each.name}={each.deployment.robot}") for each in arms)
    processes[ABOUT] = {
        **about,
        "command": f"{about['command']} {_literal(said)}",
        "environment": [f"GEMELO_PATHS_OUT={_literal(common.paths.out)}"],
        "depends_on": {name: {"condition": "process_healthy"} for name in processes},
    }
    settings = {key: value for key, value in single.items() if key != "processes" and not key.startswith("x-")}
    return {**settings, "processes": processes}


def _of_arm(
    single: Mapping[str, Process], each: StackedArm, common: Deployment, environ: Mapping[str, str]
) -> dict[str, Process]:
    """The deployment file says all: what overrides it in `environ` is in there, and blank for these processes."""
    aside = left_out(each.deployment)
    names = [name for name in single if name not in (*SHARED, ABOUT) and name not in aside]
    environment = {"GEMELO_CONFIG": str(file_of(common, each.name)), **dict.fromkeys(overriding(environ), "")}
    return {
        f"{each.name}-{name}": {
            **_placed(single[name], each.deployment.paths.out),
            "environment": [f"{key}={_literal(value)}" for key, value in environment.items()],
            "readiness_probe": _probe(single[name]["readiness_probe"], each.deployment.paths.run),
            "depends_on": {
                needed if needed in SHARED else f"{each.name}-{needed}": condition
                for needed, condition in single[name]["depends_on"].items()
                if needed not in aside
            },
        }
        for name in names
    }


def _placed(process: Process, out: str) -> Process:
    """Its log below `out`."""
    return {**process, "log_location": process["log_location"].replace(OUT, _literal(out))}


def _probe(probe: Process, run: str) -> Process:
    command = f"GEMELO_PATHS_RUN={_literal(shlex.quote(run))} {probe['exec']['command']}"
    return {**probe, "exec": {"command": command}}


def _literal(text: str) -> str:
    """process-compose puts variables in for $; two of them are one."""
    return text.replace("$", "$$")


def write(arms: Sequence[StackedArm], common: Deployment, root: Path, environ: Mapping[str, str]) -> Path:
    """Writes the deployments and the process-compose file; returns the latter's path."""
    forget_arms(common)
    keep_started(environ)
    for each in arms:
        file = file_of(common, each.name)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(deployment_file(each.deployment), encoding="utf-8")
    single = yaml.safe_load((root / "process-compose.yaml").read_text(encoding="utf-8"))
    written = file_of(common, "process-compose").with_suffix(".json")
    written.write_text(json.dumps(compose_of(single, arms, common, environ), indent=1) + "\n", encoding="utf-8")
    return written


def words(texts: Sequence[str], root: Path) -> list[str]:
    """The arms in texts as $ARMS: separated by blanks, one with blanks in quotes; a text that is a folder is one arm.

    Raises `ConfigurationError` where a quote is not closed.
    """
    found = []
    for text in texts:
        try:
            found += [text] if (root / text / "robot.toml").is_file() else shlex.split(text)
        except ValueError as error:
            raise ConfigurationError(because("arms.quote", text=text, error=str(error))) from error
    return found


def main(names: Sequence[str]) -> int:
    """0, or 1 with every problem on stderr."""
    root, language = project_root(), of_environment(os.environ)
    try:
        common = load_deployment()
        arms = stacked_arms(words(names, root), common, root)
        problems = without_doubles(each for arm in arms for each in start_problems(arm.deployment))
        if not problems:
            print(write(arms, common, root, os.environ))
    except ConfigurationError as error:
        problems = list(error.reason.causes) if error.reason.code == "arms.together" else [error.reason]
    for problem in problems:
        print(f"gemelo: {say(problem, language)}", file=sys.stderr)
    for each in arms if not problems else ():
        say_virtual(each.arm, sys.stderr, language)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
