"""`gemelo interface show`: a message as `schemas` defines it, with units, and what travels as it."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import msgspec.structs

import gemelo.schemas
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import ACTIONS, REQUESTS, TOPICS
from gemelo.tools.cli.common.errors import ExitCode, unknown
from gemelo.tools.cli.common.forms import print_value
from gemelo.tools.cli.common.language import sentence, translated
from gemelo.tools.cli.parser import Choices, Options, Parser

if TYPE_CHECKING:
    from gemelo import Robot

BASE = Message.__module__


def name_option(parser: Parser) -> None:
    """Adds the message and --json."""
    parser.add_argument("message", metavar="MESSAGE", help="as JointState, or a topic's key")
    parser.add_argument("--json", action="store_true", help="its JSON Schema, as JSON carries it on the bus")


def run(options: Options) -> ExitCode:
    """Prints one message."""
    kind = message_named(options.message)
    return print_value(schema_of(kind) if options.json else None, options.json, lambda: text_of(kind))


def choices(robot: Robot | None) -> Choices:
    """All messages."""
    return {"": sorted(messages())}


def messages() -> dict[str, type[Message]]:
    """Every message of `schemas` by its name."""
    folder = Path(gemelo.schemas.__path__[0])
    modules = [
        import_module(f"gemelo.schemas.{file.stem}") for file in sorted(folder.glob("*.py")) if file.stem != "__init__"
    ]
    return {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, type) and issubclass(value, Message) and value.__module__ == module.__name__ != BASE
    }


def message_named(name: str) -> type[Message]:
    """The message of that name, or of the topic of that key; raises `CommandError` with the nearest name."""
    for topic in TOPICS:
        if topic.key == name.strip("/"):
            return topic.message
    known = messages()
    if name not in known:
        raise unknown("message", name, sorted(known))
    return known[name]


def text_of(kind: type[Message]) -> str:
    """Its definition, those of the messages in it, and where it travels."""
    parts = [inspect.getsource(kind).rstrip()]
    known = messages()
    inner, waiting = {kind.__name__}, [kind]
    while waiting:
        for name in _named_in(waiting.pop(0), known):
            if name not in inner:
                inner.add(name)
                waiting.append(known[name])
                parts.append(inspect.getsource(known[name]).rstrip())
    return "\n\n".join([*parts, "\n".join(f"# {line}" for line in _uses(kind)) or "# inside of other messages only"])


def schema_of(kind: type[Message]) -> dict[str, Any]:
    """Its JSON Schema; a field whose value is any JSON is required there, as msgspec writes no default for it."""
    fields = msgspec.structs.fields(kind)
    if not any(isinstance(each.default, msgspec.Raw) for each in fields):
        return msgspec.json.schema(kind)
    config = kind.__struct_config__
    shown = msgspec.defstruct(
        kind.__name__, [_field(each) for each in fields], kw_only=True, tag=config.tag, tag_field=config.tag_field,
        namespace={"__doc__": kind.__doc__},
    )  # fmt: skip
    return msgspec.json.schema(shown)


def _field(info: msgspec.structs.FieldInfo) -> tuple[str, Any] | tuple[str, Any, Any]:
    if isinstance(info.default, msgspec.Raw) or info.required:
        return info.name, info.type
    if info.default_factory is not msgspec.NODEFAULT:
        return info.name, info.type, msgspec.field(default_factory=info.default_factory)
    return info.name, info.type, info.default


def _named_in(kind: type[Message], known: dict[str, type[Message]]) -> list[str]:
    """The messages that its fields are made of."""
    text = " ".join(str(annotation) for annotation in kind.__annotations__.values())
    words = "".join(letter if letter.isalnum() or letter == "_" else " " for letter in text).split()
    return [word for word in dict.fromkeys(words) if word in known]


def _uses(kind: type[Message]) -> Iterator[str]:
    uses = [
        because("cli.interface.topic", key=each.key, about=translated(each.about))
        for each in TOPICS
        if each.message is kind
    ]
    uses += [because("cli.interface.request", key=each.key) for each in REQUESTS if each.request is kind]
    uses += [because("cli.interface.answer", key=each.key) for each in REQUESTS if each.response is kind]
    yield from map(sentence, uses)
    for action in ACTIONS:
        for part, message in (("goal", action.goal), ("feedback", action.feedback), ("result", action.result)):
            if message is kind:
                yield sentence(because("cli.interface.action", key=action.key, part=part))
