"""Exit codes, the exception that ends a command with one sentence, and names looked up with a suggestion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.tools.cli.common.language import sentence

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription, Joint
    from gemelo.schemas.reasons import Reason, Remedy
    from gemelo.schemas.robot import DigitalOutput, Input, Sensor


class ExitCode(IntEnum):
    """The exit code of the process."""

    OK = 0
    FAILED = 1  # refused or aborted: the sentence says why
    USAGE = 2
    NO_STACK = 3  # no router, or nobody who answers
    CANCELLED = 130  # by Ctrl-C


class CommandError(Exception):
    """Ends a command: one sentence for a person in his language, one exit code for the shell."""

    def __init__(self, cause: Reason | BaseException, code: ExitCode = ExitCode.FAILED) -> None:
        """`cause`: why, as data; or another's error, with its reason where it has one."""
        from gemelo.schemas.reasons import plain  # 30 ms, where something is refused

        super().__init__(text_of(cause))
        self.reason = reason_of(cause) or plain(str(cause))
        self.code = code


def usage(cause: Reason | BaseException) -> CommandError:
    """The error of a command line that cannot be understood; exit code 2."""
    return CommandError(cause, ExitCode.USAGE)


def require_folder(path: Path, owner: str) -> None:
    """Raises `CommandError` where `path` is no folder, with the one beside it that is most alike."""
    if path.is_dir():
        return
    from gemelo.schemas.reasons import because, remedy  # 30 ms, where something is refused

    if path.exists():
        raise usage(because("cli.folder.not_one", owner=owner, path=str(path)))
    beside = [each.name for each in path.parent.iterdir() if each.is_dir()] if path.parent.is_dir() else []
    guess = nearest(path.name, beside)
    if guess is None:
        raise usage(because("cli.folder.none", owner=owner, path=str(path)))
    hint = remedy("did_you_mean_path", path=str(path.parent / guess))
    raise usage(because("cli.folder.other", hint, owner=owner, path=str(path)))


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most similar to `name`; None if none is similar."""
    known = list(known)
    close = get_close_matches(name, known, n=1, cutoff=0.5)
    if close:
        return close[0]
    inside = [candidate for candidate in known if name and name in candidate]
    return inside[0] if inside else None


def unknown(kind: str, name: str, known: Iterable[str], *, is_sorted: bool = True) -> CommandError:
    """`no topic "joint_state": did you mean "joint_states"?`, or the list of all known names."""
    from gemelo.schemas.reasons import because  # 30 ms, where something is refused

    return usage(because("cli.unknown", hint_of(name, known, is_sorted=is_sorted), kind=kind, name=name))


def hint_of(name: str, known: Iterable[str], *, is_sorted: bool = True) -> Remedy:
    """The known name that is most like it, else all of them."""
    from gemelo.schemas.reasons import remedy  # 30 ms, where something is refused

    known = sorted(known) if is_sorted else list(known)
    if guess := nearest(name, known):
        return remedy("did_you_mean", name=guess)
    return remedy("there_is", names=", ".join(known)) if known else remedy("there_is_none")


def joint_of(arm: ArmDescription, name: str) -> Joint:
    """The joint of that name, or of that name on the wire; raises `CommandError` with the nearest name."""
    for joint in arm.joints:
        if name in (joint.name, joint.wire_name):
            return joint
    raise unknown("joint", name, arm.joint_names)


def require_name(kind: str, name: str, parts: Sequence[Input] | Sequence[DigitalOutput] | Sequence[Sensor]) -> str:
    """Returns `name` if robot.toml has such a part; raises `CommandError` with the nearest name."""
    known = [part.name for part in parts]
    if not known:
        from gemelo.schemas.reasons import because  # 30 ms, where something is refused

        raise usage(because("cli.part.none", kind=kind))
    if name not in known:
        raise unknown(kind, name, known)
    return name


def text_of(cause: Reason | BaseException) -> str:
    """The sentence in the language of this command line; of an error without a code, its own."""
    reason = reason_of(cause)
    return str(cause) if reason is None else sentence(reason)


def reason_of(cause: Reason | BaseException) -> Reason | None:
    """What is said whole, else what an error is about; None where that has no code."""
    from gemelo.schemas.reasons import PLAIN, Reason  # 30 ms, where something is refused

    parts = (cause, getattr(cause, "message", None), getattr(cause, "reason", None))
    return next((each for each in parts if isinstance(each, Reason) and each.code != PLAIN), None)
