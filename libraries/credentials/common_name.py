"""The common name of a certificate, read from its own bytes (DER; RFC 5280, 4.1.2.6)."""

from __future__ import annotations

from binascii import a2b_base64
from pathlib import Path

from gemelo.libraries.credentials.expiry import CERTIFICATE, VERSION, elements
from gemelo.libraries.credentials.private_files import AccessError, unreadable
from gemelo.schemas.reasons import because

COMMON_NAME = b"\x55\x04\x03"  # 2.5.4.3


def common_name(file: Path) -> str:
    """Of the first certificate in a PEM file, empty if it has none; raises `AccessError`."""
    try:
        found = CERTIFICATE.search(file.read_text(encoding="ascii"))
        return _common_name(a2b_base64(found[1])) if found else ""
    except OSError as error:
        raise unreadable(file, error) from None
    except (ValueError, IndexError, StopIteration):
        raise AccessError(because("certificate.none", file=str(file))) from None


def _common_name(der: bytes) -> str:
    (_, signed), *_ = elements(next(elements(der))[1])
    _, _, _, _, (_, subject), *_ = (each for each in elements(signed) if each[0] != VERSION)
    for _, named in elements(subject):
        for _, pair in elements(named):
            (_, kind), (_, text) = elements(pair)
            if kind == COMMON_NAME:
                return text.decode()
    return ""
