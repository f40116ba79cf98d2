"""Process that expands one xacro file: it reads no file itself, and has limits of time and memory.

The protocol with its keeper is one JSON object a line: a request that it answers ("read", "find", "glob"), or the
last word ("expanded", "refused" with a reason, "failed"). What is wrong in the file is said by the keeper.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import resource
import sys
import xml.dom.minidom
import xml.parsers.expat
from collections import ChainMap
from collections.abc import Mapping
from html import unescape
from types import SimpleNamespace
from typing import Any, BinaryIO

import msgspec
import xacro
import yaml
from xacro import substitution_args

from gemelo.libraries.robot_import.xacro_sandbox.expressions import ExpressionRefused, Interpreter
from gemelo.libraries.robot_import.xacro_sandbox.symbols import functions, of_eval, symbols
from gemelo.schemas.reasons import Reason, because

CPU = 20  # [s] chosen: the largest published robots take 2
MEMORY = 1 << 30  # [bytes] of addresses, chosen: Python with xacro has 0.2 of it
FORBIDDEN = ("open", "os.", "subprocess.", "socket.", "exec", "import", "ctypes.", "shutil.", "pty.", "glob.")


class Refused(Exception):
    """What the file asks for is not allowed; the keeper gets the reason, with its place and its remedy."""


class Keeper:
    """Our end of the protocol; keeps the text of each file that was read, and the first refusal."""

    def __init__(self, answers: BinaryIO, requests: BinaryIO) -> None:
        self._answers, self._requests = answers, requests
        self.texts: dict[str, str] = {}  # by path
        self.refusal: dict[str, Any] = {}  # the first reason: xacro wraps what is raised in it

    def say(self, **message: object) -> None:
        """Sends one line."""
        self._requests.write(json.dumps(message).encode() + b"\n")
        self._requests.flush()

    def read(self, path: str) -> bytes:
        """The content of a file; raises `Refused`, and OSError where there is none."""
        content = base64.b64decode(self._asked(read=path, by=xacro.filestack[-2:][0]))
        self.texts[path] = content.decode(errors="replace")
        return content

    def find(self, package: str) -> str:
        """The folder of a package; raises `Refused`."""
        return str(self._asked(find=package))

    def glob(self, pattern: str) -> list[str]:
        """The paths that match a pattern."""
        return list(self._asked(glob=pattern, by=xacro.filestack[-1]))

    def refuse(self, reason: dict[str, Any]) -> Refused:
        """The exception to raise; the first reason is the one that is said."""
        self.refusal = self.refusal or reason
        return Refused(reason.get("code"))

    def _asked(self, **request: object) -> Any:
        self.say(**request)
        answer = json.loads(self._answers.readline())
        if "refused" in answer:
            raise self.refuse(answer["refused"])
        if "missing" in answer:
            raise FileNotFoundError(2, answer["missing"], str(request["read"]))
        return answer["value"]


class KnownArguments(dict[str, str]):
    """Values by name; remembers each name that the file declares or uses."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.known.add(name)
        return super().__getitem__(name)


def take_over(keeper: Keeper, arguments: KnownArguments) -> None:
    """Gives xacro our interpreter and our way to files in place of its own, for the life of this process."""

    def load_yaml(path: str) -> Any:
        path = xacro.abs_filename_spec(path)
        xacro.filestack.append(path)
        try:
            return yaml.load(keeper.read(path), _loader())
        finally:
            xacro.filestack.pop()

    names = symbols(
        load_yaml, arguments.__getitem__, xacro.abs_filename_spec, lambda text: keeper.say(note=text[:1000])
    )
    interpreter = Interpreter(functions(names), xacro.NameSpace)
    xacro._global_symbols = names
    xacro.safe_eval = lambda text, known, _=None: _evaluated(keeper, interpreter, text, known)
    xacro.parse = lambda _, path: _parsed(keeper, path)
    xacro.glob = SimpleNamespace(glob=keeper.glob)
    xacro.warning = lambda *parts, **_: keeper.say(note=" ".join(map(str, parts))[:1000])
    xacro.print_location = lambda: None

    def converted(name: str) -> Any:
        return substitution_args.convert_value(substitution_args._eval_arg(name, arguments), "auto")

    def environment(name: str) -> str:
        what = because("import.xacro.environment", name=name)
        raise keeper.refuse(_sent(because("file.wrong", what, file=str(xacro.filestack[-1]))))

    known = of_eval(converted, keeper.find)
    of_text = Interpreter([each for each in known.values() if callable(each)])
    substitution_args._eval = lambda text, context: str(
        _evaluated(keeper, of_text, text, ChainMap(known, {name: converted(name) for name in arguments}))
    )
    substitution_args._eval_find = keeper.find  # else it asks ROS where it is
    substitution_args._eval_env = environment
    substitution_args._eval_optenv = lambda name, default="": default


def _evaluated(keeper: Keeper, interpreter: Interpreter, text: str, names: Mapping[str, Any]) -> Any:
    try:
        return interpreter.evaluate(text, names)
    except ExpressionRefused as error:
        what = because("import.xacro.expression", error.reason, text=text.strip())
        raise keeper.refuse(_sent(placed(what, text, keeper.texts))) from error


def _sent(reason: Reason) -> dict[str, Any]:
    """As JSON has it."""
    sent: dict[str, Any] = msgspec.to_builtins(reason)
    return sent


def placed(what: Reason, text: str, texts: Mapping[str, str]) -> Reason:
    """With its file, and the line where the text stands as it is written: the macro's, else of the one being read."""
    macros = [each.history[-1][-1] for each in reversed(xacro.macrostack or []) if each.history]
    files = [*macros, *reversed(xacro.filestack), *texts]
    for file in files:
        for number, line in enumerate(unescape(texts.get(file, "")).splitlines(), 1):
            if text.strip().splitlines()[:1] and text.strip().splitlines()[0] in line:
                return because("file.line", what, file=str(file), line=number)
    return because("file.wrong", what, file=str(files[0]))


def _parsed(keeper: Keeper, path: str) -> xml.dom.minidom.Document:
    """As `xacro.parse`, without entities of the file's own: they multiply, and read other files."""
    try:
        content = keeper.read(path)
    except OSError as error:
        xacro.filestack.pop()  # as xacro does: the error is of the file that includes it
        raise xacro.XacroException(f"{error.strerror}: {error.filename}", exc=error) from error

    def entity(name: str, *_: object) -> None:
        what = because("import.xacro.entity", name=name)
        raise keeper.refuse(_sent(because("file.wrong", what, file=path)))

    parser = xml.parsers.expat.ParserCreate()
    parser.EntityDeclHandler = entity
    parser.Parse(content, True)
    return xml.dom.minidom.parseString(content)


def _loader() -> type[yaml.SafeLoader]:
    """Plain data, and numbers with the units that xacro documents."""

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # it has no types
        pass

    for unit in xacro.ConstructUnits:
        Loader.add_constructor(unit.value.tag, unit.constructor)
    return Loader


def limit() -> None:
    """Bounds this process: time, memory, no file written, no other process; where the system has these limits."""
    for what, most in (("CPU", CPU), ("AS", MEMORY), ("FSIZE", 0), ("CORE", 0), ("NPROC", 0)):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            resource.setrlimit(getattr(resource, f"RLIMIT_{what}"), (most, most))


def shut() -> None:
    """From here on this process opens, imports and runs nothing: whatever asks for it gets an exception."""
    xml.dom.minidom.parseString(b"<warm/>").toprettyxml()  # imports what it needs
    yaml.load("[1, 1.5, a]", _loader())
    _sent(because("import.xacro.entity", name="warm"))

    def refuse(event: str, _: object) -> None:
        if event.startswith(FORBIDDEN):
            raise PermissionError(f"{event} is not allowed to a xacro file")

    sys.addaudithook(refuse)


def main() -> None:
    """Entry point: the first line of the keeper is the job."""
    answers, requests = os.fdopen(0, "rb", closefd=False), os.fdopen(1, "wb", closefd=False)
    sys.stdout = sys.stderr = SimpleNamespace(write=len, flush=bool)  # nobody reads them
    limit()
    keeper, job = Keeper(answers, requests), json.loads(answers.readline())
    arguments = KnownArguments(job["arguments"])
    take_over(keeper, arguments)
    shut()
    keeper.say(**_expanded(keeper, job["path"], arguments))


def _expanded(keeper: Keeper, path: str, arguments: KnownArguments) -> dict[str, object]:
    """The last word."""
    try:
        text = xacro.process_file(path, mappings=arguments).toprettyxml(indent="  ")
    except (Exception, RecursionError) as error:
        if keeper.refusal:
            return {"refused": keeper.refusal}
        return {"failed": type(error).__name__, "text": str(error)[:4000]}
    return {"expanded": text, "known": sorted(arguments.known)}


if __name__ == "__main__":
    main()
