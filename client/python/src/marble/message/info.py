"""A server's version, limits, options and counters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from marble.base import contract
from marble.base.fields import named
from marble.message import records


@dataclass(frozen=True)
class Option:
    """A solver option: its name, default, range or choices, unit ("s" or empty) and meaning."""

    name: str
    default: float | int | bool | str
    low: float
    high: float
    unit: str
    doc: str
    choices: tuple[str, ...]


@dataclass(frozen=True)
class ServerInfo:
    """What a server is.

    limits, quota, counters: by the names of service.proto's Limits, Quota and Counters. client: the name the caller has
    there; roles: what it may do, of "solve", "observe", "admin".
    """

    version: str
    workers: int
    uptime_s: float
    client: str
    roles: tuple[str, ...]
    options: Mapping[str, Option]
    limits: Mapping[str, float | int]
    quota: Mapping[str, float | int] = field(metadata=named("limits.quota"))
    counters: Mapping[str, float | int]


def _value(number: float, kind: str, choices: tuple[str, ...]) -> float | int | bool | str:
    if kind == "TYPE_INTEGER":
        return int(number)
    if kind == "TYPE_BOOLEAN":
        return bool(number)
    return choices[int(number)] if choices else number


def server_info(data: bytes) -> ServerInfo:
    """Reads a GetInfoResponse."""
    m = contract.message("GetInfoResponse").FromString(data)
    options = {}
    for entry in m.options:
        kinds = entry.DESCRIPTOR.fields_by_name["type"].enum_type.values_by_number
        choices = tuple(entry.choices)
        default = _value(entry.default_value, kinds[entry.type].name, choices)
        options[entry.name] = Option(entry.name, default, entry.low, entry.high, entry.unit, entry.doc, choices)
    return records.read(ServerInfo, m, options=options)
