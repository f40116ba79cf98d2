"""An extension of griffe for `make docs`: the comment behind an attribute, and examples that stand in no section."""

from __future__ import annotations

import re
import textwrap
from typing import Any

from griffe import Attribute, Class, Docstring, Extension, Object

COMMENT = re.compile(r"^ +(?:self\.)?[a-z]\w*(?:: .*?| = .*?)  # (.+)$")


class CommentsAndExamples(Extension):  # type: ignore[misc]  # griffe is in .gemelo/docs alone
    """A comment behind an attribute documents it; `>>>` and indented lines of a docstring are shown as Python."""

    def on_attribute_instance(self, *, attr: Attribute, **_: Any) -> None:
        """Takes the comment of the line that declares it."""
        if attr.docstring is None and attr.lineno is not None:
            line = attr.lines_collection[attr.filepath][attr.lineno - 1]
            if found := COMMENT.match(line):
                attr.docstring = Docstring(found[1], parent=attr)

    def on_class_members(self, *, cls: Class, **_: Any) -> None:
        """A class of fields alone shows them as a table, one line each."""
        fields = [each for each in cls.attributes.values() if each.docstring is not None]
        if cls.docstring is None or cls.functions or not fields:
            return
        rows = ["| name | type | |", "|---|---|---|"]
        for each in fields:
            kind = str(each.annotation).replace("|", "\\|")
            rows.append(f"| `{each.name}` | `{kind}` | {each.docstring.value} |")
            each.docstring = None
        cls.docstring.value += "\n\n" + "\n".join(rows)

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Fences the examples."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)


def fenced(text: str) -> str:
    """The docstring with its examples as fenced code."""
    blocks = text.replace("\n\n    ", "\n    \n    ").split("\n\n")
    return "\n\n".join(map(_block, blocks))


def _block(block: str) -> str:
    if block.startswith(">>>"):
        return f"```pycon\n{block}\n```"
    text, _, code = block.partition("\n    \n")
    return f"{text}\n\n```python\n{textwrap.dedent(code)}\n```" if code else text
