"""A certificate authority of a few files, made by the openssl command: P-256 keys that never leave their folder."""

from __future__ import annotations

import ipaddress
import os
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

from services.credentials.private_files import AccessError

DAYS = 3650  # of the authority and of what it signs
KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")  # small enough for a board
EXTENSIONS = """\
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = {use}
subjectKeyIdentifier = hash
authorityKeyIdentifier = keyid
{names}
"""


class Authority:
    """An authority in two files, made when they are not there yet."""

    def __init__(self, certificate: Path, key: Path) -> None:
        self._certificate, self._key = certificate, key
        if not (certificate.exists() and key.exists()):
            self._make()

    def sign(self, hosts: Iterable[str], certificate: Path, key: Path, days: int = DAYS) -> None:
        """Makes a key and a certificate for a broker at `hosts`: names and IP addresses; raises `AccessError`."""
        names = tuple(dict.fromkeys(hosts))
        alternatives = ", ".join(map(_alternative_name, names))
        extensions = EXTENSIONS.format(use="serverAuth", names=f"subjectAltName = {alternatives}")
        self._issue("gemelo broker", extensions, certificate, key, days)

    def sign_client(self, name: str, certificate: Path, key: Path, days: int = DAYS, unit: str = "") -> None:
        """Makes a key and a certificate by which a client shows who it is; `unit` is the host that it is for."""
        self._issue(name, EXTENSIONS.format(use="clientAuth", names=""), certificate, key, days, unit)

    def has_signed(self, certificate: Path, key: Path, hosts: Iterable[str] = ()) -> bool:
        """True if both files are there, signed by this authority, and for all `hosts`."""
        if not (certificate.exists() and key.exists()):
            return False
        try:
            openssl("verify", "-no_check_time", "-CAfile", str(self._certificate), str(certificate))
            named = openssl("x509", "-in", str(certificate), "-noout", "-ext", "subjectAltName") if hosts else ""
        except AccessError:
            return False
        return {_alternative_name(host) for host in hosts} <= set(_named_in(named))

    def _make(self) -> None:
        usage = ("-addext", "keyUsage = critical, keyCertSign, cRLSign")
        subject = ("-subj", "/CN=gemelo authority", "-days", str(DAYS))
        files = ("-keyout", str(self._key), "-out", str(self._certificate))
        openssl("req", "-x509", *KEY, *subject, *usage, *files)

    def _issue(self, name: str, extensions: str, certificate: Path, key: Path, days: int, unit: str = "") -> None:
        subject = f"/OU={unit}/CN={name}" if unit else f"/CN={name}"
        with tempfile.TemporaryDirectory() as scratch:
            request, wanted = Path(scratch, "request"), Path(scratch, "extensions")
            wanted.write_text(extensions)
            openssl("req", "-new", *KEY, "-subj", subject, "-keyout", str(key), "-out", str(request))
            by = ("-CA", str(self._certificate), "-CAkey", str(self._key), "-set_serial", _serial())
            files = ("-in", str(request), "-out", str(certificate), "-extfile", str(wanted))
            openssl("x509", "-req", *by, "-days", str(days), *files)


def openssl(*arguments: str) -> str:
    """What the openssl command prints; it writes files for their owner alone. Raises `AccessError` if it cannot."""
    try:
        done = subprocess.run(
            ["openssl", *arguments], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, umask=0o077
        )
    except FileNotFoundError:
        raise AccessError(
            "the command openssl makes the certificates, and is missing: sudo apt-get install openssl"
        ) from None
    if done.returncode:
        raise AccessError(f"openssl {arguments[0]} failed: {done.stderr.strip().splitlines()[-1:]}")
    return done.stdout


def _named_in(extension: str) -> list[str]:
    """The names of a printed subjectAltName, as `_alternative_name` writes them."""
    names = extension.partition("\n")[2].strip().split(", ") if extension else []
    return [
        f"IP:{ipaddress.ip_address(each.removeprefix('IP Address:'))}" if each.startswith("IP Address:") else each
        for each in names
    ]


def _serial() -> str:
    return f"0x{int.from_bytes(os.urandom(16), 'big') >> 1:032x}"  # RFC 5280: positive, at most 20 bytes


def _alternative_name(host: str) -> str:
    try:
        return f"IP:{ipaddress.ip_address(host)}"
    except ValueError:
        pass
    if not host or not all(part.replace("-", "").isalnum() and part.isascii() for part in host.split(".")):
        raise AccessError(f'"{host}" is neither a host name nor an IP address: give what clients connect to')
    return f"DNS:{host}"
