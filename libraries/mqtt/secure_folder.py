"""The folder that locks a broker: a small authority, its certificate, users with passwords, and an ACL.

mosquitto and the embedded broker read the same files.

Everything in it is for its owner alone, and a .gitignore keeps all of it out of any repository.
"""

from __future__ import annotations

import base64
import hashlib
import secrets
from collections.abc import Iterable
from pathlib import Path

from gemelo.libraries.credentials.authority import DAYS, Authority
from gemelo.libraries.credentials.private_files import AccessError, write
from gemelo.libraries.mqtt.access import AUTHORITY, GATEWAY, read_secret
from gemelo.schemas.device_topics import FROM_DEVICE, TO_DEVICE, topic
from gemelo.schemas.reasons import because

ACL, USERS, CERTIFICATE, KEY = "acl", "users", "server.pem", "server.key"
SALT, HASH, ITERATIONS = 12, 64, 10_000  # [bytes], [bytes]; of mosquitto's "$7$": PBKDF2 with SHA-512
SECRET = 24  # [bytes] of a password
LONGEST_NAME = 31  # [bytes] that a board keeps of its name

CONF = """\
# Written by gemelo.
listener {port} {host}
{door}
set_tcp_nodelay true
{persistence}
# No limit: a stop must not wait until a device has acknowledged what came before it.
max_inflight_messages 0
connection_messages false
log_dest stderr
log_type error
log_type warning
"""
KEPT = """\
persistence true
persistence_location {folder}/
autosave_on_changes true
autosave_interval 1"""


def make(
    folder: Path, hosts: Iterable[str], devices: Iterable[str], authority: Authority | None = None, days: int = DAYS,
    renews: bool = True,
) -> tuple[str, ...]:  # fmt: skip
    """Writes or renews the folder; returns the devices that now have a user.

    `authority` signs, else one of the folder's own, which is made if it is not there; `days` are the certificate's.
    The authority and the passwords that are there stay, so that boards need not be told anew; the broker's certificate
    is made anew for `hosts` (names and IP addresses), unless it is there and not `renews`. Raises `AccessError`.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    write(folder / ".gitignore", "*\n")
    signer = authority or Authority(folder / AUTHORITY, folder / "ca.key")
    if renews or not (folder / CERTIFICATE).exists():
        signer.sign(hosts, folder / CERTIFICATE, folder / KEY, days)
    names = tuple(sorted({*map(_require_name, devices), *devices_in(folder)}))
    passwords = {user: _password(folder, user) for user in (GATEWAY, *names)}
    write(folder / USERS, "".join(f"{user}:{hashed(password)}\n" for user, password in passwords.items()))
    write(folder / ACL, acl(names))
    return names


def devices_in(folder: Path) -> tuple[str, ...]:
    """The devices that have a password there."""
    return tuple(sorted(file.stem for file in folder.glob("*.password") if file.stem != GATEWAY))


def password_of(folder: Path, user: str) -> str:
    """The password of a user; raises `AccessError` if there is none, or others can read it."""
    return read_secret(str(folder / f"{user}.password"))


def require_made(folder: Path) -> Path:
    """The folder itself; raises `AccessError` if it was never made."""
    missing = [name for name in (AUTHORITY, CERTIFICATE, KEY, USERS, ACL) if not (folder / name).is_file()]
    if missing:
        raise AccessError(because("broker.folder.incomplete", folder=str(folder), file=missing[0]))
    return folder


def listener(folder: Path) -> str:
    """The lines of mosquitto.conf that belong to a listener; raises `AccessError` if the folder was never made."""
    return lines(require_made(folder))


def lines(folder: Path) -> str:
    """The lines of a listener that ask everybody for TLS and a password, for the folder on any machine."""
    return (
        f"allow_anonymous false\ncertfile {folder / CERTIFICATE}\nkeyfile {folder / KEY}\n"
        f"password_file {folder / USERS}\nacl_file {folder / ACL}"
    )


def mosquitto_conf(host: str, port: int, door: str, persistence_folder: str = "") -> str:
    """The text of mosquitto.conf; `door` are the lines that say who may come in."""
    persistence = KEPT.format(folder=persistence_folder) if persistence_folder else "persistence false"
    return CONF.format(host=host, port=port, door=door, persistence=persistence)


def acl(devices: Iterable[str]) -> str:
    """The ACL in mosquitto's form, which the embedded broker reads too: what no line allows is denied."""
    parts = [
        "# Written by `gemelo broker secure`: a device writes only what it says itself, a gateway what devices hear."
    ]
    parts.append(_rights(GATEWAY, "+", TO_DEVICE, FROM_DEVICE))
    parts += [_rights(device, device, FROM_DEVICE, TO_DEVICE) for device in devices]
    return "\n\n".join(parts) + "\n"


def hashed(password: str) -> str:
    """The password as mosquitto 2 keeps it: `$7$<iterations>$<salt>$<PBKDF2-HMAC-SHA512>`."""
    salt = secrets.token_bytes(SALT)
    digest = hashlib.pbkdf2_hmac("sha512", password.encode(), salt, ITERATIONS, HASH)
    return f"$7${ITERATIONS}${base64.b64encode(salt).decode()}${base64.b64encode(digest).decode()}"


def _rights(user: str, device: str, writes: Iterable[str], reads: Iterable[str]) -> str:
    lines = [f"user {user}"]
    lines += [f"topic write {topic(device, kind)}" for kind in writes]
    lines += [f"topic read {topic(device, kind)}" for kind in reads]
    return "\n".join(lines)


def _password(folder: Path, user: str) -> str:
    path = folder / f"{user}.password"
    if not path.exists():
        write(path, secrets.token_urlsafe(SECRET) + "\n")
    return password_of(folder, user)


def _require_name(device: str) -> str:
    plain = device.replace("_", "").replace("-", "")
    if device == GATEWAY or not plain.isalnum() or not plain.isascii() or len(device) > LONGEST_NAME:
        raise AccessError(because("broker.device.name", name=device, limit=LONGEST_NAME, gateway=GATEWAY))
    return device
