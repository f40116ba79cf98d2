"""The common `main` of all services: arguments, deployment, node, exit code."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.errors import BusError, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.freed_memory import return_freed_memory
from gemelo.libraries.runtime.process.leaving import end_process
from gemelo.libraries.runtime.process.logs import LEVELS, line_logger
from gemelo.libraries.runtime.process.shutdown import (
    GRACE,
    ShutdownRequest,
    end_soon,
    end_with_any_thread,
    stop_on_signals,
)
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons.catalogue import read_early

Run = Callable[[Node, Deployment], None]
NodeNameOf = Callable[[Deployment], str]
EXPECTED = (ConfigurationError, BusError, RequestRefused)  # a sentence says all; anything else shows where it happened


def service(
    name: str,
    run: Run,
    arguments: Sequence[str] | None = None,
    grace: float = GRACE,
    node_name: NodeNameOf | None = None,
) -> NoReturn:
    """Opens the node `name`, runs `run(node, deployment)`, and ends the process: 0 when stopped, 1 for an error.

    It has `grace` [s] to stop; those who supervise it wait 5 s. `node_name` chooses the node's name by the deployment.
    """
    options = _parse(name, arguments)
    read_early()
    stop = ShutdownRequest()
    end_with_any_thread(line_logger(name, options.log_level), lambda: stop.is_set)
    return_freed_memory()
    with stop_on_signals(stop, grace):
        code = _run(name, run, options, stop, node_name or (lambda deployment: name))
    end_soon(code)  # whatever an exit handler does
    end_process(code)


def _run(name: str, run: Run, options: argparse.Namespace, stop: ShutdownRequest, node_name: NodeNameOf) -> int:
    log = line_logger(name, options.log_level)
    try:
        deployment = load_deployment(options.config)
        overrides = dict(options.set)
        name = node_name(deployment)
        with Node(name, deployment, overrides=overrides, log_level=options.log_level, stop=stop) as node:
            log = node.log
            return _guarded(run, node, deployment, stop)
    except EXPECTED as error:
        log.error("%s", error)
        return 1


def _guarded(run: Run, node: Node, deployment: Deployment, stop: ShutdownRequest) -> int:
    try:
        run(node, deployment)
    except KeyboardInterrupt:
        return 0 if stop.is_set else 130
    except EXPECTED as error:
        node.log.error("%s", error)
        return 1
    except Exception as error:
        if not getattr(error, "is_logged", False):
            node.log.exception("ended by an error")
        return 1
    return 0


def _parse(name: str, arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=f"gemelo-{name.replace('_', '-')}")
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="deployment file [deploy/local.toml]")
    parser.add_argument(
        "--set", type=_assignment, action="append", default=[], metavar="NAME=VALUE", help="a parameter; repeatable"
    )
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    return parser.parse_args(arguments)


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(f'"{text}": write it as name=value')
    return name, value
