"""The interface of both transports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol, TypeVar

from marble.calls.batch import BatchAnswer, BatchItem
from marble.calls.session import Session
from marble.message.request import Request, Stream
from marble.message.requests import Call
from marble.message.solve import SolveRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress
from marble.transport.handle import SolveHandle

Result = TypeVar("Result")
Item = TypeVar("Item")


class Transport(Protocol):
    """Runs requests. All methods raise FailedPrecondition once it is closed.

    address: as it is shown. The transports of marble.aio have the same methods, whose results are awaited or, of
    iterators, iterated asynchronously.
    """

    address: str

    def run(self, request: Request[Result], deadline: float | None = None) -> Result:
        """The result of a request, within `deadline` seconds; None is the client's timeout."""

    def coordinate(self, request: Request[Result], deadline: float | None = None) -> Result:
        """The same of coupled problems, of which this process is the coordinator wherever the blocks are solved."""
        return self.run(request, deadline)

    def start(self, request: SolveRequest, deadline: float | None) -> SolveHandle:
        """Begins a solve."""

    def stream(self, stream: Stream[Item]) -> Iterator[Item]:
        """The results of a stream, as they come."""

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], call: Call) -> Iterator[BatchAnswer]:
        """The results of many problems."""

    def session(self, problem: LCQP | Problem, call: Call, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, reopen: bool = True) -> Session:
        """An open session."""

    def subproblems(self, open_session: Callable[..., Any]) -> Callable[..., Any] | None:
        """What marble._core's loops solve their subproblems by: sessions that are opened so; None is marble._core."""

    def close(self) -> None:
        """Ends all that is under way."""
