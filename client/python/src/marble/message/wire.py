"""Messages whose arrays go straight between numpy and the wire, without a Python object for each number.

A packed array of doubles is its memory; one of small integers is a few vector operations away from it. All
other fields are left to protobuf: a message's parts may come in any order, so both are simply joined.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marble.base import contract

_BYTES, _FIXED64, _VARINT = 2, 1, 0


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def varints(values: NDArray[np.integer[Any]]) -> bytes:
    """Non-negative integers below 2**31, each as a varint."""
    v = np.ascontiguousarray(values, dtype=np.uint32)
    largest = int(v.max()) if v.size else 0
    if largest < 1 << 7:
        return v.astype(np.uint8).tobytes()
    # All bytes of a varint side by side in one word, lowest first; then those that are not needed fall out.
    width, kind = (2, "<u2") if largest < 1 << 14 else (4, "<u4") if largest < 1 << 28 else (8, "<u8")
    word = v.astype(kind)
    digits, needed = word & 0x7F, np.ones(v.size, dtype=kind)
    for place in range(1, min(width, 5)):
        more = (v >= 1 << 7 * place).astype(kind)
        digits |= (word >> (7 * place) & 0x7F) << (8 * place) | more << (8 * place - 1)
        needed |= more << (8 * place)
    return digits.view(np.uint8)[needed.view(np.bool_)].tobytes()


class Encoder:
    """Collects the fields of one message."""

    def __init__(self, name: str) -> None:
        self._fields: Mapping[str, Any] = contract.descriptor(name).fields_by_name
        self._chunks: list[bytes] = []
        self.size = 0

    def _add(self, *chunks: bytes) -> None:
        self._chunks.extend(chunks)
        self.size += sum(map(len, chunks))

    def _open(self, field: str, size: int) -> None:
        self._add(_varint(self._fields[field].number << 3 | _BYTES), _varint(size))

    def doubles(self, field: str, values: NDArray[np.float64]) -> None:
        """A packed field of doubles; an empty one is absent."""
        if values.size:
            data = np.ascontiguousarray(values, dtype="<f8").tobytes()
            self._open(field, len(data))
            self._add(data)

    def integers(self, field: str, values: NDArray[np.integer[Any]]) -> None:
        """A packed field of integers in [0, 2**31); an empty one is absent."""
        if values.size:
            data = varints(values)
            self._open(field, len(data))
            self._add(data)

    def message(self, field: str, inner: Encoder) -> None:
        """A field that is a message; present even if it is empty."""
        self._open(field, inner.size)
        self._chunks.extend(inner._chunks)
        self.size += inner.size

    def others(self, part: Any) -> None:
        """The fields that are set in a protobuf message of the same kind."""
        self._add(part.SerializeToString())

    def finish(self) -> bytes:
        """The whole message."""
        return b"".join(self._chunks)


@functools.cache
def _arrays_of(name: str) -> dict[int, tuple[str, str]]:
    """Fields that are arrays of doubles, ("z", ""), or messages that have such, ("solution", its type)."""
    found: dict[int, tuple[str, str]] = {}
    for field in contract.descriptor(name).fields:
        repeated = field.is_repeated if hasattr(field, "is_repeated") else field.label == field.LABEL_REPEATED
        if repeated and field.type == field.TYPE_DOUBLE:
            found[field.number] = (field.name, "")
        elif not repeated and field.message_type is not None and _arrays_of(field.message_type.full_name):
            found[field.number] = (field.name, field.message_type.full_name)
    return found


def _read_varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7


def _split(data: bytes, at: int, end: int, name: str, path: str, arrays: dict[str, NDArray[np.float64]]) -> bytes:
    """Takes the arrays out of data[at:end], and returns the rest."""
    wanted = _arrays_of(name)
    rest: list[bytes] = []
    kept = at  # from here on nothing was taken out
    while at < end:
        begin = at
        key = data[at]  # most numbers have a single byte
        at += 1
        if key > 0x7F:
            key, at = _read_varint(data, begin)
        kind = key & 7
        if kind == _BYTES:
            stop = data[at]
            at += 1
            if stop > 0x7F:
                stop, at = _read_varint(data, at - 1)
            stop += at
        elif kind == _VARINT:
            stop = at + 1
            while data[stop - 1] > 0x7F:
                stop += 1
        else:
            stop = at + (8 if kind == _FIXED64 else 4)
        if kind == _BYTES and (key >> 3) in wanted:
            field, inner = wanted[key >> 3]
            rest.append(data[kept:begin])
            kept = stop
            if inner:
                body = _split(data, at, stop, inner, f"{path}{field}.", arrays)
                rest += (_varint(key), _varint(len(body)), body)
            else:
                arrays[path + field] = np.frombuffer(data, "<f8", (stop - at) // 8, at).astype(float)
        at = stop
    rest.append(data[kept:end])
    return b"".join(rest)


def decode(name: str, data: bytes) -> tuple[Any, dict[str, NDArray[np.float64]]]:
    """A message, and its arrays of doubles by their paths ("solution.z"), which the message itself then lacks.

    Arrays within repeated messages stay where they are.
    """
    arrays: dict[str, NDArray[np.float64]] = {}
    rest = _split(data, 0, len(data), contract.descriptor(name).full_name, "", arrays)
    return contract.message(name).FromString(rest), arrays
