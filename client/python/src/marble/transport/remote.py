"""Calls on servers, over gRPC."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

from marble import errors
from marble.base.lazy import lazy
from marble.calls.batch import Batch, BatchAnswer, BatchItem
from marble.calls.session import Session
from marble.connection import connect
from marble.connection.connect import ConnectOptions
from marble.connection.patience import Patience
from marble.connection.rpc import Rpc
from marble.errors import Cancelled
from marble.message import requests
from marble.message.request import Message, Request, Stream, Unary
from marble.message.requests import Call
from marble.message.solve import SolveRequest
from marble.model.lcqp import LCQP
from marble.model.problem import Problem
from marble.model.solution import Progress
from marble.transport.local import LocalTransport
from marble.transport.transport import SolveHandle, Transport

grpc: Any = lazy("grpc")
block_sessions: Any = lazy("marble.transport.block_sessions")
Result = TypeVar("Result")
Item = TypeVar("Item")


class RemoteTransport(Transport):
    """address, who: as connect.channels has them. timeout: seconds, of calls without a deadline; None is none."""

    def __init__(self, address: str | Sequence[str] | None, who: ConnectOptions, timeout: float | None,
                 wait: float | None) -> None:
        self._addresses, self._who, self._timeout, self._wait = connect.each(address), who, timeout, wait
        patience = Patience(wait)
        self.address, make = connect.channels(grpc, address, who)
        self._rpc = Rpc(make, who.metadata(), timeout, patience)

    def run(self, request: Request[Result], deadline: float | None = None) -> Result:
        """See Transport."""
        try:
            message = request.encode()
            return self._rpc.repeated(self._rpc.tries(request.method, deadline),
                                      lambda seconds: self._once(request, message, seconds))
        finally:
            request.close()

    def _once(self, request: Request[Result], message: Message, seconds: float | None,
              begun: Callable[[Any], object] = lambda _: None) -> Result:
        if isinstance(message, bytes) and request.streams:
            stream = self._rpc.stream(request.method, message, seconds)
            begun(stream)
            return read_result(stream, request)
        future = (self._rpc.unary(request.method, message, seconds) if isinstance(message, bytes) else
                  self._rpc.upload(request.method, iter(message), seconds))
        result: Any = request.read(self._rpc.result(future))
        answer: Result = result
        return answer

    def coordinate(self, request: Any, deadline: float | None = None) -> Any:
        """See Transport. Blocks are solved in sessions, dealt to the servers of the address in turns."""
        limit = self._timeout if deadline is None else deadline
        with contextlib.ExitStack() as ends:
            each = [ends.enter_context(contextlib.closing(one)) for one in self._each()]
            blocks = block_sessions.BlockSessions(self, each, request.call, request.name, limit)
            ends.callback(blocks.close)
            result = LocalTransport().run(request, limit, open_block=blocks.open)
        return dataclasses.replace(result, repeated=blocks.repeated)

    def _each(self) -> list[RemoteTransport]:
        """One of each server alone; of TLS the first name counts, as for all of them."""
        who = self._who
        if len(self._addresses) > 1 and who.credentials() is not None and not who.tls_server_name:
            who = dataclasses.replace(who, tls_server_name=connect.host(self._addresses[0]))
        # What one server of several has lost is for the others, at once.
        wait = 0.0 if len(self._addresses) > 1 else self._wait
        return [RemoteTransport(address, who, self._timeout, wait) for address in self._addresses]

    def start(self, request: SolveRequest, deadline: float | None) -> SolveHandle:
        """See Transport."""
        self._rpc.check_open()
        message, tries = request.encode(), self._rpc.tries(request.method, deadline)
        ended = threading.Event()  # no other try is made
        cancelled = threading.Event()
        streams: list[Any] = []

        def begun(stream: Any) -> None:
            streams[:] = [stream]
            if cancelled.is_set():
                stream.cancel()

        def pause(seconds: float) -> None:
            if self._rpc.pause(seconds, ended):
                raise Cancelled("the solve was ended while its server was lost")

        def cancel() -> None:
            cancelled.set()
            ended.set()
            for stream in streams:
                stream.cancel()

        def stop() -> None:
            ended.set()
            self.run(Unary("Jobs/Cancel", requests.job("CancelJobRequest", handle.job_id()), bytes))

        handle = SolveHandle(cancel, stop)
        request.accepted = handle.accept
        handle.begin(lambda: self._rpc.repeated(
            tries, lambda seconds: self._once(request, message, seconds, begun), pause))
        return handle

    def stream(self, stream: Stream[Item]) -> Iterator[Item]:
        """See Transport. A lost stream is opened again where that repeats nothing."""
        tries = self._rpc.tries(stream.method, math.inf)
        received = False
        while True:
            tries.left()
            messages = self._rpc.stream(stream.method, stream.encode())
            try:
                for data in messages:
                    tries.reached()
                    received = True
                    yield from stream.read(data)
                return
            except grpc.RpcError as error:
                lost = errors.from_rpc(error)
            finally:
                messages.cancel()
            if received and not stream.resumes:
                raise lost
            self._rpc.pause(tries.pause(lost))

    def batch(self, problems: Iterable[LCQP | Problem | BatchItem], call: Call) -> Iterator[BatchAnswer]:
        """See Transport."""
        return Batch(self._rpc, problems, call).answers()

    def session(self, problem: LCQP | Problem, call: Call, latest_only: bool = False,
                progress: Callable[[int, Progress], object] | None = None, reopen: bool = True) -> Session:
        """See Transport."""
        return Session(self._rpc, problem, call, latest_only, progress, reopen)

    def subproblems(self, open_session: Callable[..., Any]) -> Callable[..., Any] | None:
        """See Transport."""
        return open_session

    def close(self) -> None:
        """See Transport."""
        self._rpc.close()


def read_result(stream: Any, request: Request[Result]) -> Result:
    """The result at the end of a stream."""
    try:
        for data in stream:
            if (result := request.read(data)) is not None:
                return result
    except grpc.RpcError as error:
        raise errors.from_rpc(error) from None
    finally:
        stream.cancel()
    raise Cancelled("the stream ended without an answer")
