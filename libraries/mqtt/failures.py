"""The sentence with the remedy for every failure to join a broker: network, TLS, password or ACL."""

from __future__ import annotations

import errno
import socket
import ssl

from gemelo.libraries.mqtt.access import BrokerAccess

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


def failure(error: OSError, access: BrokerAccess) -> str:
    """The sentence for a connection that could not be made, or broke before the broker had answered."""
    match error:
        case ssl.SSLCertVerificationError():
            return _untrusted(error, access)
        case ssl.SSLError() if not isinstance(error, ssl.SSLEOFError):
            return _tls_failure(error, access)
        case socket.gaierror():
            return f'no machine is called "{access.host}" here: check the name, or give the broker\'s IP address'
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return f"no connection to {access}: no descriptor is left for one (`ulimit -n`); it is tried again"
    if access.tls is not None and isinstance(error, (ssl.SSLEOFError, ConnectionResetError, BrokenPipeError)):
        return f"{access} broke off the TLS handshake: is it the port for TLS (mostly 8883)?"
    return f"no MQTT broker answers at {access.host}:{access.port} ({error}): {_is_it_there(access)}"


def refusal(code: int, words: str, access: BrokerAccess) -> str:
    """The sentence for a broker that has answered, and refuses; `code` and `words` of its CONNACK."""
    if code not in NOT_AUTHORISED:
        return f"{access} refuses us: {words}"
    if not access.user:
        return f"{access} lets nobody in without a user and a password: set mqtt.user and mqtt.password_file"
    return (
        f'{access} refuses user "{access.user}" ({words}): the password is wrong, or it does not know this user or '
        "denies it its last will; check the broker's users and ACL"
    )


def silence(access: BrokerAccess) -> str:
    """The sentence for a connection that the broker has closed without an answer."""
    if access.tls is None:
        return f"{access} closed the connection without an answer: does that port want TLS (mqtt.tls = true)?"
    if access.has_certificate:
        return f"{access} closed the connection without an answer: does it know the authority of mqtt.certificate?"
    return (
        f"{access} closed the connection without an answer: does it want a certificate of ours (mqtt.certificate, "
        "mqtt.key)?"
    )


def denial(topic: str, access: BrokerAccess, verb: str = "write") -> str:
    """The sentence for an ACL that denies."""
    who = f'user "{access.user}"' if access.user else "anybody without a user"
    return f"{access} does not let {who} {verb} {topic}: its ACL must allow it"


def needs_a_person(error: OSError) -> bool:
    """True if trying again cannot help before somebody has changed a certificate or a setting."""
    return isinstance(error, (ssl.SSLError, socket.gaierror))


def _is_it_there(access: BrokerAccess) -> str:
    if access.is_ours:
        return "is the process `broker` running?"
    return "does it run, and are its address and port right (mqtt.host, mqtt.port)?"


def _untrusted(error: ssl.SSLCertVerificationError, access: BrokerAccess) -> str:
    start = f"the certificate of {access}"
    match error.verify_code:
        case code if code == EXPIRED:
            return f"{start} has expired: renew it (`gemelo broker secure` does for its own), or set this clock right"
        case code if code == NOT_YET_VALID:
            return f"{start} is not valid yet: set this machine's clock right, or the broker's and make another"
        case code if code in (OTHER_NAME, OTHER_ADDRESS):
            return (
                f'{start} is for another name than "{access.host}": connect by a name that is in it, or make another '
                f"(`gemelo broker secure --host {access.host}` does)"
            )
        case code if code in UNKNOWN_AUTHORITY:
            trusted = (
                f"the authority in {access.authority}" if access.authority else "an authority that this system knows"
            )
            return f"{start} is not signed by {trusted}: set mqtt.ca to the certificate of the authority that signed it"
    return f"{start} is not believed: {error.verify_message}"


def _tls_failure(error: ssl.SSLError, access: BrokerAccess) -> str:
    reason = error.reason or ""
    if reason in NO_TLS:
        return f"what answers at {access.host}:{access.port} does not speak TLS: is it the port for TLS (mostly 8883)?"
    if any(word in reason for word in WANTS_CERTIFICATE):
        known = "does not believe mqtt.certificate" if access.has_certificate else "wants a certificate of ours"
        return f"{access} {known} ({reason}): set mqtt.certificate and mqtt.key to one that its authority has signed"
    return f"TLS with {access} failed: {reason or error}"
