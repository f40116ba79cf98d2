"""Signatures of files: ECDSA with the curve P-256 and SHA-256, by the openssl command."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from gemelo.schemas.errors import ConfigurationError


class SignatureError(ConfigurationError):
    """A key or a file that cannot be used; the message names it and the remedy."""


def make_key(private: Path, public: Path) -> None:
    """Makes a pair, PEM; the private key is for its owner alone. Raises SignatureError, also where one is there."""
    if private.exists():
        raise SignatureError(
            f"{private} is there already: devices that know its public key would take nothing signed by another one"
        )
    private.parent.mkdir(parents=True, exist_ok=True)
    _openssl("genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256", "-out", str(private))
    private.chmod(0o600)
    public.write_bytes(_openssl("pkey", "-in", str(private), "-pubout"))


def sign(private: Path, data: bytes) -> bytes:
    """The signature of `data`, DER; raises SignatureError."""
    with tempfile.NamedTemporaryFile() as file:
        file.write(data)
        file.flush()
        return _openssl("dgst", "-sha256", "-sign", str(private), file.name)


def is_signed(public: str, digest: bytes, signature: bytes) -> bool:
    """True if the owner of the public key (PEM text) has signed data with this SHA-256; raises SignatureError."""
    with tempfile.TemporaryDirectory() as folder:
        files = {name: Path(folder, name) for name in ("key", "digest", "signature")}
        for name, content in (("key", public.encode()), ("digest", digest), ("signature", signature)):
            files[name].write_bytes(content)
        try:
            _openssl(
                "pkeyutl", "-verify", "-pubin", "-inkey", str(files["key"]), "-in", str(files["digest"]),
                "-sigfile", str(files["signature"]), "-pkeyopt", "digest:sha256",
            )  # fmt: skip
        except _Failed:
            return False
        return True


class _Failed(SignatureError):
    """openssl has said no."""


def _openssl(*arguments: str) -> bytes:
    """What the command writes; raises SignatureError."""
    try:
        done = subprocess.run(
            ["openssl", *arguments], capture_output=True, check=False, stdin=subprocess.DEVNULL, umask=0o077
        )
    except FileNotFoundError:
        raise SignatureError(
            "the command openssl makes and checks signatures, and is missing: sudo apt-get install openssl"
        ) from None
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise _Failed(f"openssl {arguments[0]} failed: {said[0] if said else 'without a word'}")
    return done.stdout
