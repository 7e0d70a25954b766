"""Fills result types from the server's messages and from the values of marble._core.

A result type is a dataclass, and its fields are the table: an annotation says how a value is read, and `named` in
base/fields.py where the message has another name for it. A field that the message lacks, or that is optional there and
not set, takes the dataclass's default; without one it is None.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import types
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from marble.base import contract
from marble.base.fields import name_in_message

Record = TypeVar("Record")
Arrays = Mapping[str, NDArray[np.float64]]
Reader = Callable[[Any, Arrays | None, str], Any]
_EMPTY: NDArray[np.float64] = np.zeros(0)


class _Field:
    """hint: without None. default: MISSING where there is none."""

    def __init__(self, name: str, hint: Any, is_optional: bool, default: Any, in_message: str) -> None:
        self.name, self.hint, self.is_optional = name, hint, is_optional
        self.default, self.in_message = default, in_message


@functools.cache
def _fields(kind: Any) -> tuple[_Field, ...]:
    hints = typing.get_type_hints(kind)
    found = []
    for field in dataclasses.fields(kind):
        hint = hints[field.name]
        inner = [hint]
        if typing.get_origin(hint) in (types.UnionType, typing.Union):
            inner = [one for one in typing.get_args(hint) if one is not types.NoneType]
        default = field.default_factory() if callable(field.default_factory) else field.default
        found.append(_Field(field.name, inner[0] if len(inner) == 1 else Any, len(inner) == 1 and inner[0] is not hint,
                            default, name_in_message(field.name, field.metadata)))
    return tuple(found)


@functools.cache
def _defaults(kind: Any) -> tuple[dict[str, Any], tuple[tuple[str, Any], ...], Any]:
    """Default values, factories of such, and the class's __post_init__ or None."""
    return ({field.name: field.default for field in dataclasses.fields(kind)
             if field.default is not dataclasses.MISSING},
            tuple((field.name, field.default_factory) for field in dataclasses.fields(kind)
                  if field.default_factory is not dataclasses.MISSING),
            getattr(kind, "__post_init__", None))


def _made(kind: Any, values: dict[str, Any]) -> Any:
    """A record with these attributes, and the defaults of all others; its __init__ takes twice as long."""
    made = object.__new__(kind)
    attributes = made.__dict__
    fixed, factories, complete = _defaults(kind)
    attributes.update(fixed)
    for name, factory in factories:
        if name not in values:
            attributes[name] = factory()
    attributes.update(values)
    if complete is not None:
        complete(made)
    return made


def _is(kind: type, hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, kind)


def _array_kind(hint: Any) -> Any:
    """np.float64 of NDArray[np.float64]; None of what is no array."""
    return typing.get_args(typing.get_args(hint)[1])[0] if typing.get_origin(hint) is np.ndarray else None


def _item(hint: Any) -> Any:
    """The dataclass of a list or tuple of such; else None."""
    arguments = typing.get_args(hint)
    return arguments[0] if typing.get_origin(hint) in (list, tuple) and dataclasses.is_dataclass(arguments[0]) else None


# ---------------------------------------------------------------- messages


@functools.cache
def _table(kind: Any, message: str) -> tuple[tuple[str, ...], Callable[[Any], tuple[Any, ...]],
                                             tuple[tuple[str, Reader], ...]]:
    """The attributes that are copied, their values in a message, and the others with their readers."""
    described = contract.descriptor(message).fields_by_name
    plain: list[tuple[str, str]] = []
    readers: list[tuple[str, Reader]] = []
    for field in _fields(kind):
        head = field.in_message.partition(".")[0]
        if head not in described:
            continue
        reader = _reader(field, described[head])
        if reader is None:
            plain.append((field.name, field.in_message))
        else:
            readers.append((field.name, reader))
    return tuple(name for name, _ in plain), _getter([there for _, there in plain]), tuple(readers)


def _getter(names: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Of all the attributes at once."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda message: tuple(getattr(message, name) for name in names)


def _reader(field: _Field, described: Any) -> Reader | None:
    """None where the message's value is the attribute's."""
    name, get = field.in_message, attrgetter(field.in_message)
    value = _value(field, described)
    is_message = described.message_type is not None
    if "." in name or not described.has_presence or (is_message and not (field.is_optional or field.hint is Any)):
        return value
    absent = None if (default := _absent(field)) is dataclasses.MISSING else default
    reader: Reader = value or (lambda message, arrays, path: get(message))
    return lambda message, arrays, path: reader(message, arrays, path) if message.HasField(name) else absent


def _value(field: _Field, described: Any) -> Reader | None:
    name, hint, get = field.in_message, field.hint, attrgetter(field.in_message)
    if (kind := _array_kind(hint)) is not None:
        if kind is np.float64:
            return lambda message, arrays, path: (_filled(get(message), kind) if arrays is None else
                                                  arrays.get(path + name, _EMPTY))
        return lambda message, arrays, path: _filled(get(message), kind)
    if _is(enum.Enum, hint):
        members = {number: hint(text) for number, text in contract.enum_names(hint.__name__).items() if number}
        if (absent := _absent(field)) is dataclasses.MISSING:
            return lambda message, arrays, path: members[get(message)]
        return lambda message, arrays, path: members.get(get(message), absent)
    inner = None if described.message_type is None else described.message_type.full_name
    if dataclasses.is_dataclass(hint):
        return lambda message, arrays, path: read(hint, get(message), arrays, f"{path}{name}.", inner)
    if (item := _item(hint)) is not None:
        whole: Any = typing.get_origin(hint)
        return lambda message, arrays, path: whole(read(item, one, None, "", inner) for one in get(message))
    if typing.get_origin(hint) is tuple:
        return lambda message, arrays, path: tuple(get(message))
    if typing.get_origin(hint) is Mapping:
        convert = options if inner == "marble.v1.SolveOptions" else numbers_of
        return lambda message, arrays, path: convert(get(message))
    return None


def _filled(values: Any, kind: Any) -> Any:
    return np.fromiter(values, kind, len(values))


def _absent(field: _Field) -> Any:
    return None if field.default is dataclasses.MISSING and field.is_optional else field.default


def read(kind: type[Record], message: Any, arrays: Arrays | None = None, path: str = "",
         name: str | None = None, **given: Any) -> Record:
    """A record of a message, whose full name is `name` if that is known.

    arrays, path: what wire.decode took out of the message, and where its own stand there; None if nothing was taken.
    given: attributes that are not of the message, or that replace what it has.
    """
    made: Any = kind
    plain, get, readers = _table(made, name or message.DESCRIPTOR.full_name)
    values = dict(zip(plain, get(message), strict=True))
    for attribute, reader in readers:
        if attribute not in given:
            values[attribute] = reader(message, arrays, path)
    values.update(given)
    record: Record = _made(made, values)
    return record


def options(message: Any) -> dict[str, float | int | bool | str]:
    """The options that are set in a SolveOptions."""
    return {field.name: value if field.enum_type is None else contract.enum_names(field.enum_type.name)[value]
            for field, value in message.ListFields()}


def numbers_of(message: Any) -> dict[str, float | int]:
    """All numbers of a message by their names."""
    return {field.name: getattr(message, field.name) for field in message.DESCRIPTOR.fields
            if field.message_type is None}


# ---------------------------------------------------------------- marble._core


def _converters(kind: Any) -> Iterator[tuple[str, Any]]:
    for field in _fields(kind):
        hint = field.hint
        if (number := _array_kind(hint)) is not None:
            yield field.name, np.asarray if number is np.float64 else functools.partial(np.array, dtype=number)
        elif _is(enum.Enum, hint):
            members = {member.value: member for member in hint}
            yield field.name, members.get if field.is_optional else members.__getitem__
        elif dataclasses.is_dataclass(hint):
            yield field.name, functools.partial(_of_core_or_none, hint)
        elif (item := _item(hint)) is not None:
            yield field.name, functools.partial(_all_of_core, typing.get_origin(hint), item)
        elif typing.get_origin(hint) is tuple:
            yield field.name, tuple


@functools.cache
def _core_table(kind: Any) -> tuple[tuple[str, ...], tuple[tuple[str, Callable[[Any], Any]], ...]]:
    return tuple(field.name for field in _fields(kind)), tuple(_converters(kind))


def _all_of_core(whole: Any, kind: Any, values: Any) -> Any:
    return whole(of_core(kind, one) for one in values)


def _of_core_or_none(kind: Any, values: Any) -> Any:
    return None if values is None else of_core(kind, values)


def of_core(kind: type[Record], values: dict[str, Any] | Sequence[Any], **given: Any) -> Record:
    """A record of marble._core's values, by the attributes' names or in their order. given: as in read."""
    made: Any = kind
    names, converters = _core_table(made)
    parts = dict(values) if isinstance(values, dict) else dict(zip(names, values, strict=True))
    for name, convert in converters:
        if name in parts and name not in given:
            parts[name] = convert(parts[name])
    parts.update(given)
    record: Record = _made(made, parts)
    return record
