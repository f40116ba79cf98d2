"""Text as editors save it: UTF-8, with or without a byte order mark; another encoding is named."""

from __future__ import annotations

from pathlib import Path

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because, remedy

MARKS = {  # of encodings that are not taken; UTF-32 first, as its mark begins with that of UTF-16
    b"\xff\xfe\x00\x00": "UTF-32",
    b"\x00\x00\xfe\xff": "UTF-32",
    b"\xff\xfe": "UTF-16",
    b"\xfe\xff": "UTF-16",
}
REMEDY = remedy("save_as_utf8")


class NotUtf8(ReasonedError, ValueError):
    """Says which encoding it seems to be, or the line that is none, and the remedy."""


def read_text(path: Path) -> str:
    """The file's text, without a byte order mark; raises OSError, or `NotUtf8`."""
    return decode_text(path.read_bytes())


def decode_text(raw: bytes) -> str:
    """The text without a byte order mark, its line ends as they are in Python; raises `NotUtf8`."""
    for mark, encoding in MARKS.items():
        if raw.startswith(mark):
            raise NotUtf8(because("file.encoding.other", REMEDY, encoding=encoding))
    if b"\0" in raw[:64]:
        raise NotUtf8(because("file.encoding.none", REMEDY))
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line, byte = raw.count(b"\n", 0, error.start) + 1, raw[error.start]
        raise NotUtf8(because("file.encoding.byte", REMEDY, line=line, byte=byte)) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")
