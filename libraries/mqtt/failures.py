"""The reason for every failure to join a broker: network, TLS, password or ACL."""

from __future__ import annotations

import errno
import socket
import ssl

from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.schemas.reasons import Reason, because

# X509_V_ERR_* of OpenSSL's x509_vfy.h.
NOT_YET_VALID, EXPIRED, OTHER_NAME, OTHER_ADDRESS = 9, 10, 62, 64
UNKNOWN_AUTHORITY = (2, 7, 18, 19, 20, 21)
NO_TLS = (
    "WRONG_VERSION_NUMBER",
    "PACKET_LENGTH_TOO_LONG",
    "HTTP_REQUEST",
    "UNEXPECTED_MESSAGE",
    "RECORD_LAYER_FAILURE",
)
WANTS_CERTIFICATE = ("CERTIFICATE_REQUIRED", "HANDSHAKE_FAILURE", "UNKNOWN_CA", "BAD_CERTIFICATE", "ACCESS_DENIED")
NOT_AUTHORISED = (4, 5, 134, 135)  # CONNACK of MQTT 3.1.1 and 5


def failure(error: OSError, access: BrokerAccess) -> Reason:
    """The reason for a connection that could not be made, or broke before the broker had answered."""
    match error:
        case ssl.SSLCertVerificationError():
            return _untrusted(error, access)
        case ssl.SSLError() if not isinstance(error, ssl.SSLEOFError):
            return _tls_failure(error, access)
        case socket.gaierror():
            return because("broker.no_host", host=access.host)
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return because("broker.no_descriptor", broker=access.place)
    if access.tls is not None and isinstance(error, (ssl.SSLEOFError, ConnectionResetError, BrokenPipeError)):
        return because("broker.tls.broke_off", broker=access.place)
    where = {"broker": access.place, "error": str(error)}
    return because("broker.none.own", **where) if access.is_ours else because("broker.none", **where)


def refusal(code: int, words: str, access: BrokerAccess) -> Reason:
    """The reason for a broker that has answered, and refuses; `code` and `words` of its CONNACK."""
    if code not in NOT_AUTHORISED:
        return because("broker.refuses", broker=access.place, words=words)
    if not access.user:
        return because("broker.user.none", broker=access.place)
    return because("broker.user.refused", broker=access.place, user=access.user, words=words)


def silence(access: BrokerAccess) -> Reason:
    """The reason for a connection that the broker has closed without an answer."""
    if access.tls is None:
        return because("broker.closed.tls", broker=access.place)
    if access.has_certificate:
        return because("broker.closed.authority", broker=access.place)
    return because("broker.closed.certificate", broker=access.place)


def denial(topic: str, access: BrokerAccess, verb: str = "write") -> Reason:
    """The reason for an ACL that denies; `verb` is write or read."""
    if access.user:
        return because("broker.acl.user", broker=access.place, user=access.user, verb=verb, topic=topic)
    return because("broker.acl.anybody", broker=access.place, verb=verb, topic=topic)


def needs_a_person(error: OSError) -> bool:
    """True if trying again cannot help before somebody has changed a certificate or a setting."""
    return isinstance(error, (ssl.SSLError, socket.gaierror))


def _untrusted(error: ssl.SSLCertVerificationError, access: BrokerAccess) -> Reason:
    match error.verify_code:
        case code if code == EXPIRED:
            return because("broker.tls.expired", broker=access.place)
        case code if code == NOT_YET_VALID:
            return because("broker.tls.not_yet_valid", broker=access.place)
        case code if code in (OTHER_NAME, OTHER_ADDRESS):
            return because("broker.tls.other_name", broker=access.place, host=access.host)
        case code if code in UNKNOWN_AUTHORITY:
            if access.authority:
                return because("broker.tls.other_authority", broker=access.place, authority=access.authority)
            return because("broker.tls.unknown_authority", broker=access.place)
    return because("broker.tls.not_believed", broker=access.place, problem=error.verify_message)


def _tls_failure(error: ssl.SSLError, access: BrokerAccess) -> Reason:
    reason = error.reason or ""
    if reason in NO_TLS:
        return because("broker.tls.none", broker=access.place)
    if any(word in reason for word in WANTS_CERTIFICATE):
        if access.has_certificate:
            return because("broker.tls.ours_not_believed", broker=access.place, problem=reason)
        return because("broker.tls.ours_wanted", broker=access.place, problem=reason)
    return because("broker.tls.failed", broker=access.place, problem=reason or str(error))
