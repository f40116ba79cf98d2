"""A certificate authority of a few files, made by the openssl command: P-256 keys that never leave their folder.

A new authority takes the place of a former one without an outage: what it signs carries a certificate by which the
former one vouches for it (the "new with old" of RFC 4210, 4.4). Who trusts only the former believes it, and who trusts
both believes everybody.
"""

from __future__ import annotations

import ipaddress
import math
import os
import secrets
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path

from gemelo.libraries.credentials.common_name import common_name
from gemelo.libraries.credentials.expiry import CERTIFICATE, days_left, expiry
from gemelo.libraries.credentials.private_files import AccessError

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


AUTHORITY_EXTENSIONS = """\
basicConstraints = critical, CA:TRUE
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
authorityKeyIdentifier = keyid
"""
FORMER, VOUCHER = "former.pem", "voucher.pem"  # beside the authority's certificate


class Authority:
    """An authority in two files, made when they are not there yet; two more while a former one is still trusted."""

    def __init__(self, certificate: Path, key: Path) -> None:
        self._certificate, self._key = certificate, key
        self._former, self._voucher = certificate.with_name(FORMER), certificate.with_name(VOUCHER)
        if certificate.exists() != key.exists():  # another one would end every link of those who trust this one
            has, lacks = (certificate, key) if certificate.exists() else (key, certificate)
            anew = f"delete {has} to begin with another authority, whose files everybody must then get at once"
            raise AccessError(f"{lacks} is missing beside {has.name}: bring it back; or {anew}")
        if not certificate.exists():
            _make(certificate, key)

    @property
    def has_former(self) -> bool:
        """True from `renew` to `retire`."""
        return self._former.exists()

    @property
    def trusted(self) -> str:
        """PEM of all whose certificates are to be believed: this authority, and a former one."""
        return "".join(file.read_text() for file in (self._certificate, self._former) if file.exists())

    def renew(self) -> None:
        """Makes another authority, for which the present one vouches; that one signs nothing any more.

        Raises `AccessError` while an earlier one is trusted.
        """
        if self.has_former:
            raise AccessError("an authority before this one is still trusted: retire that one before this is renewed")
        with tempfile.TemporaryDirectory(dir=self._certificate.parent) as scratch:
            certificate, key, request, wanted, voucher = (Path(scratch, name) for name in ("c", "k", "r", "e", "v"))
            subject = _make(certificate, key)
            openssl("req", "-new", "-key", str(key), "-subj", subject, "-out", str(request))
            wanted.write_text(AUTHORITY_EXTENSIONS)
            left = max(1, math.ceil(days_left(expiry(self._certificate))))
            self._sign(request, wanted, voucher, left)
            os.replace(voucher, self._voucher)
            shutil.copyfile(self._certificate, self._former)
            os.replace(key, self._key)
            os.replace(certificate, self._certificate)

    def retire(self) -> None:
        """The former authority is trusted no more; raises `AccessError` if there is none."""
        if not self.has_former:
            raise AccessError("no former authority is trusted: there is nothing to retire")
        self._former.unlink()
        self._voucher.unlink()

    def sign(self, hosts: Iterable[str], certificate: Path, key: Path, days: int = DAYS) -> None:
        """Makes a key and a certificate for a broker at `hosts`: names and IP addresses; raises `AccessError`."""
        names = tuple(dict.fromkeys(hosts))
        alternatives = ", ".join(map(_alternative_name, names))
        extensions = EXTENSIONS.format(use="serverAuth", names=f"subjectAltName = {alternatives}")
        self._issue("gemelo broker", extensions, certificate, key, days)

    def sign_client(self, name: str, certificate: Path, key: Path, days: int = DAYS, unit: str = "") -> None:
        """Makes a key and a certificate by which a client shows who it is; `unit` is the host that it is for."""
        self._issue(name, EXTENSIONS.format(use="clientAuth", names=""), certificate, key, days, unit)

    def has_signed(self, certificate: Path, key: Path, hosts: Iterable[str] = (), name: str = "") -> bool:
        """True if both files are there, signed by this authority, as it stands now, for all `hosts` and for `name`."""
        if not (certificate.exists() and key.exists()):
            return False
        if CERTIFICATE.findall(certificate.read_text())[1:] != CERTIFICATE.findall(self._vouched):
            return False
        if name and common_name(certificate) != name:
            return False
        try:
            openssl("verify", "-no_check_time", "-CAfile", str(self._certificate), str(certificate))
            named = openssl("x509", "-in", str(certificate), "-noout", "-ext", "subjectAltName") if hosts else ""
        except AccessError:
            return False
        return {_alternative_name(host) for host in hosts} <= set(_named_in(named))

    @property
    def _vouched(self) -> str:
        return self._voucher.read_text() if self.has_former else ""

    def _issue(self, name: str, extensions: str, certificate: Path, key: Path, days: int, unit: str = "") -> None:
        subject = f"/OU={unit}/CN={name}" if unit else f"/CN={name}"
        with tempfile.TemporaryDirectory(dir=certificate.parent) as scratch:
            request, wanted, own, signed = (Path(scratch, name) for name in ("r", "e", "k", "c"))
            wanted.write_text(extensions)
            openssl("req", "-new", *KEY, "-subj", subject, "-keyout", str(own), "-out", str(request))
            self._sign(request, wanted, signed, days)
            with signed.open("a") as file:
                file.write(self._vouched)
            os.replace(own, key)
            os.replace(signed, certificate)

    def _sign(self, request: Path, extensions: Path, certificate: Path, days: int) -> None:
        by = ("-CA", str(self._certificate), "-CAkey", str(self._key), "-set_serial", _serial())
        files = ("-in", str(request), "-out", str(certificate), "-extfile", str(extensions))
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
        raise AccessError(f"openssl {arguments[0]} failed: {' '.join(done.stderr.strip().splitlines()[-1:])}")
    return done.stdout


def _make(certificate: Path, key: Path) -> str:
    """An authority's certificate and key; returns its name, which no other has, as openssl writes it."""
    name = f"/CN=gemelo authority {secrets.token_hex(4)}"
    usage = ("-addext", "keyUsage = critical, keyCertSign, cRLSign")
    files = ("-keyout", str(key), "-out", str(certificate))
    openssl("req", "-x509", *KEY, "-subj", name, "-days", str(DAYS), *usage, *files)
    return name


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
