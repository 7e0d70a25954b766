"""How the fields of this package's result types are named in the contract's messages."""

from __future__ import annotations

from typing import Final

from marble.base.tables import SOLUTION_VECTORS

_KEY: Final = "field of the message"


def named(field: str) -> dict[str, str]:
    """Metadata of a dataclass field that has another name in its message; "a.b" is field b of message a."""
    return {_KEY: field}


def name_in_message(attribute: str, metadata: object) -> str:
    """The name in the message of a dataclass field."""
    own = metadata.get(_KEY) if hasattr(metadata, "get") else None
    return own or SOLUTION_VECTORS.get(attribute, attribute)
