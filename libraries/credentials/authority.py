"""A certificate authority of a few files: P-256 keys that never leave their folder.

A new authority takes the place of a former one without an outage: what it signs carries a certificate by which the
former one vouches for it (the "new with old" of RFC 4210, 4.4). Who trusts only the former believes it, and who trusts
both believes everybody.
"""

from __future__ import annotations

import ipaddress
import math
import secrets
import shutil
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from gemelo.libraries.credentials.common_name import common_name
from gemelo.libraries.credentials.expiry import CERTIFICATE, days_left, expiry
from gemelo.libraries.credentials.keys import new_key, private_pem
from gemelo.libraries.credentials.private_files import AccessError, write
from gemelo.schemas.reasons import because

DAYS = 3650  # of the authority and of what it signs
FORMER, VOUCHER = "former.pem", "voucher.pem"  # beside the authority's certificate


class Authority:
    """An authority in two files, made when they are not there yet; two more while a former one is still trusted."""

    def __init__(self, certificate: Path, key: Path) -> None:
        self._certificate, self._key = certificate, key
        self._former, self._voucher = certificate.with_name(FORMER), certificate.with_name(VOUCHER)
        if certificate.exists() != key.exists():  # another one would end every link of those who trust this one
            has, lacks = (certificate, key) if certificate.exists() else (key, certificate)
            raise AccessError(because("certificate.authority.half", lacks=str(lacks), has=str(has), name=has.name))
        if not certificate.exists():
            own = new_key()
            write(key, private_pem(own))
            write(certificate, _pem(_self_signed(own)))

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
            raise AccessError(because("certificate.authority.former"))
        own = new_key()
        certificate = _self_signed(own)
        left = max(1, math.ceil(days_left(expiry(self._certificate))))
        voucher = self._sign(_authority(certificate.subject, own.public_key(), left))
        write(self._voucher, _pem(voucher))
        shutil.copyfile(self._certificate, self._former)
        write(self._key, private_pem(own))
        write(self._certificate, _pem(certificate))

    def retire(self) -> None:
        """The former authority is trusted no more; raises `AccessError` if there is none."""
        if not self.has_former:
            raise AccessError(because("certificate.authority.no_former"))
        self._former.unlink()
        self._voucher.unlink()

    def sign(self, hosts: Iterable[str], certificate: Path, key: Path, days: int = DAYS) -> None:
        """Makes a key and a certificate for a broker at `hosts`: names and IP addresses; raises `AccessError`."""
        names = x509.SubjectAlternativeName(map(_alternative_name, dict.fromkeys(hosts)))
        self._issue("gemelo broker", ExtendedKeyUsageOID.SERVER_AUTH, names, certificate, key, days)

    def sign_client(self, name: str, certificate: Path, key: Path, days: int = DAYS, unit: str = "") -> None:
        """Makes a key and a certificate by which a client shows who it is; `unit` is the host that it is for."""
        self._issue(name, ExtendedKeyUsageOID.CLIENT_AUTH, None, certificate, key, days, unit)

    def has_signed(self, certificate: Path, key: Path, hosts: Iterable[str] = (), name: str = "") -> bool:
        """True if both files are there, signed by this authority, as it stands now, for all `hosts` and for `name`."""
        if not (certificate.exists() and key.exists()):
            return False
        if CERTIFICATE.findall(certificate.read_text())[1:] != CERTIFICATE.findall(self._vouched):
            return False
        if name and common_name(certificate) != name:
            return False
        try:
            signed = x509.load_pem_x509_certificate(certificate.read_bytes())
            signed.verify_directly_issued_by(self._own)
        except (ValueError, TypeError, InvalidSignature):
            return False
        return {_alternative_name(host) for host in hosts} <= _names_of(signed)

    @property
    def _own(self) -> x509.Certificate:
        try:
            return x509.load_pem_x509_certificate(self._certificate.read_bytes())
        except ValueError:
            raise AccessError(because("certificate.authority.none", file=str(self._certificate))) from None

    @property
    def _own_key(self) -> ec.EllipticCurvePrivateKey:
        try:
            key = load_pem_private_key(self._key.read_bytes(), None)
        except (ValueError, TypeError):
            key = None
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise AccessError(because("certificate.authority.no_key", file=str(self._key)))
        return key

    @property
    def _vouched(self) -> str:
        return self._voucher.read_text() if self.has_former else ""

    def _issue(
        self,
        name: str,
        use: x509.ObjectIdentifier,
        names: x509.SubjectAlternativeName | None,
        certificate: Path,
        key: Path,
        days: int,
        unit: str = "",
    ) -> None:
        own = new_key()
        builder = (
            _certificate(_subject(name, unit), own.public_key(), days)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(digital_signature=True), critical=True)
            .add_extension(x509.ExtendedKeyUsage([use]), critical=False)
        )
        signed = self._sign(builder if names is None else builder.add_extension(names, critical=False))
        write(key, private_pem(own))
        write(certificate, _pem(signed) + self._vouched)

    def _sign(self, builder: x509.CertificateBuilder) -> x509.Certificate:
        return _signed(builder, self._own.subject, self._own_key)


def _self_signed(own: ec.EllipticCurvePrivateKey) -> x509.Certificate:
    """An authority's certificate with a name that no other has."""
    subject = _subject(f"gemelo authority {secrets.token_hex(4)}")
    return _signed(_authority(subject, own.public_key(), DAYS), subject, own)


def _authority(subject: x509.Name, public: ec.EllipticCurvePublicKey, days: int) -> x509.CertificateBuilder:
    return (
        _certificate(subject, public, days)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .add_extension(_usage(key_cert_sign=True, crl_sign=True), critical=True)
    )


def _certificate(subject: x509.Name, public: ec.EllipticCurvePublicKey, days: int) -> x509.CertificateBuilder:
    """From now on, for so many days; of less than none, one that has expired."""
    now = datetime.now(UTC)
    end = now + timedelta(days=days)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .public_key(public)
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(now, end - timedelta(days=1)))
        .not_valid_after(end)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
    )


def _signed(builder: x509.CertificateBuilder, issuer: x509.Name, own: ec.EllipticCurvePrivateKey) -> x509.Certificate:
    by = x509.AuthorityKeyIdentifier.from_issuer_public_key(own.public_key())
    return builder.issuer_name(issuer).add_extension(by, critical=False).sign(own, SHA256())


def _usage(*, digital_signature: bool = False, key_cert_sign: bool = False, crl_sign: bool = False) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=digital_signature,
        key_cert_sign=key_cert_sign,
        crl_sign=crl_sign,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _subject(name: str, unit: str = "") -> x509.Name:
    """Raises `AccessError` for a name of no or of more than 64 characters (RFC 5280, A.1)."""
    try:
        parts = [(NameOID.ORGANIZATIONAL_UNIT_NAME, unit)] if unit else []
        return x509.Name([x509.NameAttribute(*part) for part in (*parts, (NameOID.COMMON_NAME, name))])
    except ValueError as error:
        raise AccessError(because("certificate.name", name=name, error=str(error))) from None


def _pem(certificate: x509.Certificate) -> str:
    return certificate.public_bytes(Encoding.PEM).decode()


def _names_of(certificate: x509.Certificate) -> set[x509.GeneralName]:
    try:
        return set(certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value)
    except x509.ExtensionNotFound:
        return set()


def _alternative_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    if not host or not all(part.replace("-", "").isalnum() and part.isascii() for part in host.split(".")):
        raise AccessError(because("certificate.host", host=host))
    return x509.DNSName(host)
