"""Private keys: P-256, small enough for a board."""

from __future__ import annotations

from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, EllipticCurvePrivateKey, generate_private_key
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat


def new_key() -> EllipticCurvePrivateKey:
    """One that nobody else has."""
    return generate_private_key(SECP256R1())


def private_pem(key: EllipticCurvePrivateKey) -> str:
    """PKCS #8, without a password: the file's mode keeps it."""
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()
