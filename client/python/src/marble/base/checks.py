"""What an argument is, whatever its class."""

from __future__ import annotations

import numbers


def is_number(value: object) -> bool:
    """Whether it is a real number, of Python or of numpy; NaN is one."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)
