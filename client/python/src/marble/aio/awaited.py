"""Makes methods for asyncio of the methods for threads: the same parameters, with awaited results."""

from __future__ import annotations

import functools
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def awaited(method: Callable[Concatenate[Any, Parameters], Result],
             ) -> Callable[Concatenate[Any, Parameters], Coroutine[Any, Any, Result]]:
    """For a method whose last act is one call of a transport, or of another method that is awaited here."""
    @functools.wraps(method)
    async def call(self: Any, /, *arguments: Parameters.args, **named: Parameters.kwargs) -> Result:
        running: Any = method(self, *arguments, **named)
        result: Result = await running
        return result

    return call


def iterated(method: Callable[Concatenate[Any, Parameters], Iterator[Result]],
              ) -> Callable[Concatenate[Any, Parameters], AsyncIterator[Result]]:
    """For a method that yields."""
    return cast(Callable[Concatenate[Any, Parameters], AsyncIterator[Result]], method)
