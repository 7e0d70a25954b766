"""How the fields of this package's result types are named in the contract's messages."""

from __future__ import annotations

from typing import Final

SOLUTION_VECTORS: Final = {
    "z": "z",
    "y": "equality_multipliers",
    "nu": "inequality_multipliers",
    "xi": "complementarity_multipliers_l",
    "eta": "complementarity_multipliers_r",
}
"""The point and its multipliers: names of this package and of marble.v1.Solution, WarmStart and AnswerVectors."""
_KEY: Final = "field of the message"


def named(field: str) -> dict[str, str]:
    """Metadata of a dataclass field that has another name in its message; "a.b" is field b of message a."""
    return {_KEY: field}


def name_in_message(attribute: str, metadata: object) -> str:
    """The name in the message of a dataclass field."""
    own = metadata.get(_KEY) if hasattr(metadata, "get") else None
    return own or SOLUTION_VECTORS.get(attribute, attribute)
