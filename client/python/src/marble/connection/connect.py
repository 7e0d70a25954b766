"""Addresses of servers, and the identity of the client."""

from __future__ import annotations

import dataclasses
import ipaddress
import json
import os
import pathlib
import re
import socket
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from marble.base import tables
from marble.base.checks import is_number
from marble.base.lazy import lazy
from marble.base.tables import LONGEST_CLIENT_NAME, LONGEST_UNIX_PATH
from marble.connection.patience import CONNECT_S
from marble.errors import InvalidArgument, Unavailable

grpc: Any = lazy("grpc")

DEFAULT_KEEPALIVE_S: Final = 30.0
CONTROL: Final = "control"
# As often as a server permits by default, half of its --keepalive-s: of more pings it closes the connection.
# Of data that it does not acknowledge, an update's say, the second is all that counts: TCP gives up then.
_CONTROL_S: Final = (10.0, 1.0)
_KEEPALIVE_RANGE_S: Final = (0.5, 86400.0)
_DNS: Final = "dns:///"
# A server that was restarted is found again within the longest of these, not within gRPC's two minutes.
_FIRST_BACKOFF_MS: Final = 100
_LONGEST_BACKOFF_MS: Final = 1_000


def _printable(text: str) -> bool:
    return text.isascii() and text.isprintable()


def _process_name() -> str:
    program = pathlib.Path(sys.argv[0] or "python")
    name = (program.parent if program.name == "__main__.py" else program).name[:40]
    return re.sub(r"[^!-~]", "_", name) + f"-{os.getpid()}"


@dataclass(frozen=True)
class ConnectOptions:
    """The identity of the caller, encryption, and when a server counts as lost.

    Files are read once; a bad one is InvalidArgument with its field.

    token: sent with every call as "authorization: Bearer TOKEN", in plaintext too; printable ASCII without spaces.
    name: what the client calls itself, for a server that does not know better; at most 64 printable ASCII characters.
    tls: encrypt; also on where any other tls_ field is set. tls_ca: PEM file of who may vouch for the server; without
    it the system's roots. tls_certificate, tls_key: PEM files of the client's own, both or none. tls_server_name: the
    name in the server's certificate, where it is not the address's host.
    keepalive: seconds of silence, in [0.5, 86400], after which a server is pinged; it counts as lost if it does not
    answer for half as long. "control", for loops that must know at once: 10 s, and 1 s for an answer or for what was
    sent to arrive. A server permits a ping every 10 s, half of its --keepalive-s; of more it closes the connection.
    """

    token: str = dataclasses.field(default="", repr=False)
    name: str = ""
    tls: bool = False
    tls_ca: str = ""
    tls_certificate: str = ""
    tls_key: str = ""
    tls_server_name: str = ""
    keepalive: float | str = DEFAULT_KEEPALIVE_S

    @staticmethod
    def from_environment(**given: Any) -> ConnectOptions:
        """MARBLE_TOKEN, MARBLE_CLIENT_NAME, MARBLE_TLS_CA, _CERTIFICATE and _KEY, where `given` has None.

        Without MARBLE_CLIENT_NAME the name is the program's with its process id.
        """
        values: dict[str, Any] = {"token": os.environ.get("MARBLE_TOKEN", ""),
                  "name": os.environ.get("MARBLE_CLIENT_NAME") or _process_name()}
        for part in ("ca", "certificate", "key"):
            values[f"tls_{part}"] = os.environ.get(f"MARBLE_TLS_{part.upper()}", "")
        return ConnectOptions(**{**values, **{k: v for k, v in given.items() if v is not None}})

    def __post_init__(self) -> None:
        if not _printable(self.token) or " " in self.token:
            raise InvalidArgument("token", "must be printable ASCII without spaces")
        if len(self.name) > LONGEST_CLIENT_NAME or not _printable(self.name):
            raise InvalidArgument("name", f"must be at most {LONGEST_CLIENT_NAME} bytes of printable ASCII")
        if bool(self.tls_certificate) != bool(self.tls_key):
            missing = "tls_key" if self.tls_certificate else "tls_certificate"
            raise InvalidArgument(missing, "certificate and key must be given together")
        if self.keepalive != CONTROL:
            least, most = _KEEPALIVE_RANGE_S
            if not (is_number(self.keepalive) and least <= float(self.keepalive) <= most):
                raise InvalidArgument("keepalive", f'must be in [{least:g}, {most:g}] seconds or "{CONTROL}"',
                                      value=repr(self.keepalive))

    def keepalive_s(self) -> tuple[float, float]:
        """Seconds of silence before a ping, and until its answer."""
        return _CONTROL_S if self.keepalive == CONTROL else (float(self.keepalive), float(self.keepalive) / 2)

    def metadata(self) -> tuple[tuple[str, str], ...]:
        """The metadata of every call."""
        pairs = []
        if self.token:
            pairs.append(("authorization", f"Bearer {self.token}"))
        if self.name:
            pairs.append(("marble-client", self.name))
        return tuple(pairs)

    def credentials(self) -> Any:
        """gRPC's channel credentials; None is plaintext."""
        if not (self.tls or self.tls_ca or self.tls_certificate or self.tls_server_name):
            return None
        return grpc.ssl_channel_credentials(_read_pem("tls_ca", self.tls_ca), _read_pem("tls_key", self.tls_key),
                                            _read_pem("tls_certificate", self.tls_certificate))


def _read_pem(field: str, path: str) -> bytes | None:
    """The content of a PEM file; gRPC would report a bad one at the first handshake only, as "unavailable"."""
    if not path:
        return None
    try:
        content = pathlib.Path(path).read_bytes()
    except OSError as error:
        raise InvalidArgument(field, f"cannot be read: {error.strerror}", value=path) from None
    if b"-----BEGIN " not in content:
        raise InvalidArgument(field, "must be a PEM file", value=path)
    return content


def _host_and_port(address: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not host or not port.isascii() or not port.isdigit() or not 1 <= int(port) <= 65535:
        raise InvalidArgument("address", "must be host:port, port in [1, 65535], or unix:PATH", value=repr(address))
    return host.strip("[]"), int(port)


def host(address: str) -> str:
    """Of host:port."""
    return _host_and_port(address)[0]


def _resolved(addresses: Sequence[str]) -> str:
    """One gRPC target of several addresses; names are looked up now."""
    found: list[tuple[int, str]] = []
    for address in addresses:
        if address.startswith("unix:"):
            raise InvalidArgument("address", "of several addresses none may be a unix socket", value=repr(address))
        host, port = _host_and_port(address)
        try:
            infos = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except OSError as error:
            raise Unavailable(f"{host}: {error.strerror}") from None
        for info in infos:
            ip = ipaddress.ip_address(info[4][0])
            entry = (ip.version, f"{ip}:{port}" if ip.version == 4 else f"[{ip}]:{port}")
            if entry not in found:
                found.append(entry)
    version = 4 if any(entry[0] == 4 for entry in found) else 6  # gRPC takes one family only
    return f"ipv{version}:" + ",".join(text for kind, text in found if kind == version)


@dataclass(frozen=True)
class Target:
    """Where a channel goes: gRPC's name of it, its options, and the address to show."""

    name: str
    shown: str
    options: tuple[tuple[str, Any], ...]


def service_config() -> str:
    """Turns between healthy servers, of several."""
    return json.dumps({"loadBalancingConfig": [{"round_robin": {}}], "healthCheckConfig": {"serviceName": ""}})


def named(address: str | Sequence[str] | None) -> str | Sequence[str]:
    """The address, or where there is none MARBLE_SERVER, else 127.0.0.1:50051."""
    return (os.environ.get("MARBLE_SERVER") or tables.DEFAULT_ADDRESS) if address is None else address


def server_of(server: str | Sequence[str] | None) -> str | Sequence[str]:
    """The address of a `server` argument: None is MARBLE_SERVER, else this process."""
    return (os.environ.get("MARBLE_SERVER") or tables.LOCAL_ADDRESS) if server is None else server


def each(address: str | Sequence[str] | None) -> list[str]:
    """The addresses one by one; all that a name has (dns:///) are one."""
    address = named(address)
    return [part.strip() for part in address.split(",")] if isinstance(address, str) else list(address)


def target(address: str | Sequence[str] | None, connect: ConnectOptions) -> Target:
    """`address`: host:port or unix:PATH; or several host:port, in a list or with commas; or dns:///host:port, which is
    every address of the name. None is MARBLE_SERVER, else 127.0.0.1:50051.
    """
    addresses = each(address)
    if not addresses:
        raise InvalidArgument("address", "must be at least one")
    by_name = len(addresses) == 1 and addresses[0].startswith(_DNS)
    silence_s, answer_s = connect.keepalive_s()
    options: list[tuple[str, Any]] = [
        # patience.py retries. With retries of its own, gRPC 1.51 may never complete a stream whose connection fails.
        ("grpc.enable_retries", 0),
        ("grpc.max_receive_message_length", -1),  # the server has its limit; the client must be able to read
        ("grpc.max_send_message_length", -1),
        ("grpc.keepalive_time_ms", round(1e3 * silence_s)),
        ("grpc.keepalive_timeout_ms", round(1e3 * answer_s)),
        ("grpc.http2.max_pings_without_data", 0),  # as many as a long solve takes
        ("grpc.initial_reconnect_backoff_ms", _FIRST_BACKOFF_MS),
        ("grpc.max_reconnect_backoff_ms", _LONGEST_BACKOFF_MS),
        ("grpc.min_reconnect_backoff_ms", int(1e3 * CONNECT_S)),  # how long it may take to connect
        ("grpc.enable_http_proxy", 0),  # http_proxy is set for browsers
    ]
    if by_name or len(addresses) > 1:
        options.append(("grpc.service_config", service_config()))
    if connect.tls_server_name:
        options.append(("grpc.ssl_target_name_override", connect.tls_server_name))
    if len(addresses) > 1:
        name = _resolved(addresses)
        host, _ = _host_and_port(addresses[0])
        if not connect.tls_server_name:
            options.append(("grpc.default_authority", host))
            if connect.credentials() is not None:
                options.append(("grpc.ssl_target_name_override", host))
    else:
        name = addresses[0]
        if name.startswith("unix:"):
            if not 1 <= len(name.encode()) - 5 <= LONGEST_UNIX_PATH:
                raise InvalidArgument("address", f"must have a path of 1 to {LONGEST_UNIX_PATH} bytes after unix:",
                                      value=repr(name))
        else:
            _host_and_port(name.removeprefix(_DNS))
    return Target(name, ", ".join(addresses), tuple(options))


def channels(library: Any, address: str | Sequence[str] | None,
             connect: ConnectOptions) -> tuple[str, Callable[..., Any]]:
    """The address as it is shown, and a function that opens a channel of `library`, grpc or grpc.aio, to it: with a
    connection of its own, or with that of all others of this process.
    """
    found, credentials = target(address, connect), connect.credentials()

    def make(own: bool, library: Any = library) -> Any:
        options = (*found.options, ("grpc.use_local_subchannel_pool", 1)) if own else found.options
        if credentials is None:
            return library.insecure_channel(found.name, options)
        return library.secure_channel(found.name, credentials, options)

    return found.shown, make
