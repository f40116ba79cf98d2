"""Expiry dates of certificates, read from their own bytes (DER, ITU-T X.690; fields of RFC 5280, 4.1).

A process that moves an arm starts no other one to learn this, and a host needs no openssl for it.
"""

from __future__ import annotations

import re
import time
from binascii import a2b_base64
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from gemelo.libraries.credentials.private_files import AccessError, unreadable
from gemelo.schemas.reasons import because

DAY = 86_400.0  # [s]
WARN_WITHIN = 30.0  # [days] before its end a certificate is spoken of, and `gemelo deploy keys` renews it
CERTIFICATE = re.compile(r"-----BEGIN CERTIFICATE-----(.+?)-----END CERTIFICATE-----", re.DOTALL)  # 1: its base64
VERSION = 0xA0  # tag of the one field of a certificate that may be missing
UTC_TIME = 0x17  # tag of a time with two digits of the year, to 2049


def expiry(file: Path) -> float:
    """[s] UNIX time after which the first certificate of a PEM file is not valid; raises `AccessError`."""
    return expiries(file)[0]


def expiries(file: Path) -> tuple[float, ...]:
    """As `expiry`, of every certificate in the file; each in [s]."""
    try:
        found = tuple(map(_expiry_of_pem, CERTIFICATE.findall(file.read_text(encoding="ascii"))))
    except OSError as error:
        raise unreadable(file, error) from None
    except ValueError:
        found = ()
    if not found:
        raise AccessError(because("certificate.none", file=str(file)))
    return found


def not_after(der: bytes) -> float:
    """[s] UNIX time after which a certificate is not valid; raises `ValueError` for bytes that are no certificate."""
    try:
        (_, signed), *_ = elements(next(elements(der))[1])
        _, _, _, (_, validity), *_ = (each for each in elements(signed) if each[0] != VERSION)
        _, (tag, text) = elements(validity)
    except (IndexError, StopIteration) as error:
        raise ValueError("no certificate") from error
    said = text.decode("ascii")
    if tag == UTC_TIME:
        said = f"{'19' if said[:2] >= '50' else '20'}{said}"
    return datetime.strptime(said, "%Y%m%d%H%M%SZ").replace(tzinfo=UTC).timestamp()


def days_left(ends: float, now: float | None = None) -> float:
    """[days] from `now` to `ends`, both in [s] UNIX time; below 0 after it."""
    return (ends - (time.time() if now is None else now)) / DAY


def ending(ends: float, now: float | None = None, within: float = WARN_WITHIN) -> str:
    """What to say of a certificate that ends at `ends` [s]; empty where that is more than `within` [days] away."""
    left = days_left(ends, now)
    if left > within:
        return ""
    return f"ends in {left:.0f} days" if left > 0.0 else "has expired"


def _expiry_of_pem(text: str) -> float:
    return not_after(a2b_base64(text))


def elements(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Tag and content of each element in a row; raises `IndexError` or `ValueError` where it is cut off."""
    at = 0
    while at < len(data):
        tag, length, at = data[at], data[at + 1], at + 2
        if length & 0x80:
            size = length & 0x7F
            length, at = int.from_bytes(data[at : at + size], "big"), at + size
        if at + length > len(data):
            raise ValueError("an element is longer than what holds it")
        yield tag, data[at : at + length]
        at += length
