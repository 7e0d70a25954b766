"""The transport of an address."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from marble.connection import connect
from marble.connection.rpc import check_deadline

Kind = TypeVar("Kind")


def open_transport(local: Callable[[float | None], Kind], remote: Callable[..., Kind],
                   address: str | Sequence[str] | None, timeout: float | None, wait: float | None,
                   **who: Any) -> Kind:
    """Of an address as marble.Client takes it: `local` of "local", else `remote`. who: fields of ConnectOptions."""
    timeout = check_deadline(timeout)
    if connect.is_local(address):
        return local(timeout)
    return remote(address, connect.ConnectOptions.from_environment(**who), timeout, wait)
