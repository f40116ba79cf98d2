"""Signatures of files: ECDSA with the curve P-256 and SHA-256."""

from __future__ import annotations

from pathlib import Path

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ec import ECDSA, EllipticCurvePrivateKey, EllipticCurvePublicKey
from cryptography.hazmat.primitives.asymmetric.utils import Prehashed
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from gemelo.libraries.credentials.keys import new_key, private_pem
from gemelo.libraries.credentials.private_files import write
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import because, remedy


class SignatureError(ConfigurationError):
    """A key or a file that cannot be used; the message names it and the remedy."""


def make_key(private: Path, public: Path) -> None:
    """Makes a pair, PEM; the private key is for its owner alone. Raises SignatureError, also where one is there."""
    if private.exists():
        raise SignatureError(because("signature.key.exists", file=str(private)))
    private.parent.mkdir(parents=True, exist_ok=True)
    key = new_key()
    write(private, private_pem(key))
    public.write_bytes(key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))


def sign(private: Path, data: bytes) -> bytes:
    """The signature of `data`, DER; raises SignatureError."""
    try:
        key = load_pem_private_key(private.read_bytes(), None)
    except OSError as error:
        problem = error.strerror or str(error)
        raise SignatureError(because("signature.key.unreadable", file=str(private), error=problem)) from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise SignatureError(because("signature.key.none", file=str(private))) from None
    if not isinstance(key, EllipticCurvePrivateKey):
        raise SignatureError(because("signature.key.other", remedy("make_update_key"), file=str(private)))
    return key.sign(data, ECDSA(SHA256()))


def is_signed(public: str, digest: bytes, signature: bytes) -> bool:
    """True if the owner of the public key (PEM text) has signed data with this SHA-256; raises SignatureError."""
    try:
        key = load_pem_public_key(public.encode())
    except (ValueError, UnsupportedAlgorithm):
        raise SignatureError(because("signature.public.none")) from None
    if not isinstance(key, EllipticCurvePublicKey):
        return False
    try:
        key.verify(signature, digest, ECDSA(Prehashed(SHA256())))
    except (InvalidSignature, ValueError):
        return False
    return True
