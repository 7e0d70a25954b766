"""What a server tells about itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from marble.base import contract


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
    quota: Mapping[str, float | int]
    counters: Mapping[str, float | int]


def _numbers(message: object) -> dict[str, float | int]:
    fields = message.DESCRIPTOR.fields  # type: ignore[attr-defined]
    return {field.name: getattr(message, field.name) for field in fields if field.message_type is None}


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
    return ServerInfo(m.version, m.workers, m.uptime_s, m.client, tuple(m.roles), options, _numbers(m.limits),
                      _numbers(m.limits.quota), _numbers(m.counters))
