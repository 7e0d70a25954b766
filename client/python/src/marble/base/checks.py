"""What an argument is, whatever its class."""

from __future__ import annotations

import numbers
import operator


def is_number(value: object) -> bool:
    """Whether it is a real number that a double can hold, of Python or of numpy; NaN is one."""
    if not isinstance(value, numbers.Real) or isinstance(value, bool) or type(value).__name__ == "timedelta64":
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def is_whole(value: object, least: int, most: int) -> bool:
    """Whether it is a whole number in [least, most], of Python or of numpy, and no truth value."""
    if not isinstance(value, numbers.Integral) or isinstance(value, bool):
        return False
    try:
        return least <= operator.index(value) <= most
    except TypeError:  # of numpy's times, which call themselves whole numbers
        return False
