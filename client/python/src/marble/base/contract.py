"""The messages of marble.v1, from the descriptor set that the package carries.

Classes are made when they are first wanted, in a pool of their own: no generated code that fits one version of
protobuf only, and no quarrel with other packages that bring a google.rpc.
"""

from __future__ import annotations

import functools
import pathlib
import threading
from typing import Any

_lock = threading.Lock()
_made: Any = None


def _pool() -> Any:
    global _made
    with _lock:
        if _made is None:
            from google.protobuf import descriptor_pb2, descriptor_pool

            content = pathlib.Path(__file__).parent.with_name("contract.pb").read_bytes()
            _made = descriptor_pool.DescriptorPool()
            for file in descriptor_pb2.FileDescriptorSet.FromString(content).file:
                _made.AddSerializedFile(file.SerializeToString())
        return _made


def descriptor(name: str) -> Any:
    """The descriptor of a message, by its name within marble.v1 or by its full name."""
    return _pool().FindMessageTypeByName(name if "." in name else "marble.v1." + name)


@functools.cache
def message(name: str) -> Any:
    """The class of a message, by its name within marble.v1 or by its full name."""
    from google.protobuf import message_factory

    if hasattr(message_factory, "GetMessageClass"):
        return message_factory.GetMessageClass(descriptor(name))
    return message_factory.MessageFactory(_pool()).GetPrototype(descriptor(name))  # protobuf < 4.22


@functools.cache
def enum_names(name: str) -> dict[int, str]:
    """Numbers of an enum and its values' names in small letters, without the enum's own."""
    values = _pool().FindEnumTypeByName("marble.v1." + name).values
    prefix = values[0].name[: -len("UNSPECIFIED")]
    return {value.number: value.name[len(prefix):].lower() for value in values}


@functools.cache
def enum_numbers(name: str) -> dict[str, int]:
    """The inverse of enum_names."""
    return {text: number for number, text in enum_names(name).items()}
