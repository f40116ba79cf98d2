"""`gemelo action send_goal`: a trajectory from a file or a pipe, straight to the gateway, without a planner."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from schemas.actions import GoalStatusCode
from schemas.message import Message
from schemas.topics import Action
from services.cli.exits import CommandError, ExitCode, usage
from services.cli.interrupt import two_stage_interrupt
from services.cli.move import LONGEST_HOLD, cancel_once
from services.cli.yaml import dump
from services.runtime.errors import GoalRefused

if TYPE_CHECKING:
    from services.cli.session import Session


def text_of(source: str) -> str:
    """JSON given as itself, as `-` for standard input, or as the name of a file."""
    if source.lstrip().startswith("{"):
        return source
    try:
        if source == "-":
            return sys.stdin.read()
        with open(source, encoding="utf-8") as file:
            return file.read()
    except (OSError, UnicodeDecodeError) as error:
        raise usage(f"cannot read the goal: {error}") from error


def send_goal(
    session: Session, action: Action[Message, Message, Message], goal: Message, with_feedback: bool
) -> ExitCode:
    """Sends the goal and waits for its result; Ctrl-C cancels."""
    client = session.node.action(action)

    def on_feedback(feedback: Any) -> None:
        print(f"feedback:\n{indented(feedback)}---", flush=True)

    with two_stage_interrupt() as interrupt:
        try:
            handle = client.send(goal, on_feedback=on_feedback if with_feedback else None)
        except GoalRefused as error:
            raise CommandError(f"refused by {action.server}: {error}") from error
        print(f"accepted: goal {handle.goal_id}", flush=True)
        outcome = handle.wait(LONGEST_HOLD, on_tick=lambda: cancel_once(handle, interrupt, quiet=False))
    print(f"result: {outcome.status.name}\n{indented(outcome.result) if outcome.result else ''}", end="")
    if outcome.status is GoalStatusCode.SUCCEEDED:
        return ExitCode.OK
    return ExitCode.CANCELLED if interrupt.is_set else ExitCode.FAILED


def indented(message: Message) -> str:
    return "".join(f"  {line}\n" for line in dump(message).splitlines())
