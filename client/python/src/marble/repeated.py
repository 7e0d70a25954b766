"""One problem again and again with other numbers: what the adapters of modelling tools stand on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from numpy.typing import ArrayLike

from marble.calls.session import Session
from marble.client import Client
from marble.connection.connect import server_of
from marble.errors import Aborted
from marble.model.lcqp import LCQP, vector
from marble.model.solution import Solution

_SEARCHED: Final = "max_small_problem_nodes"  # in the detail of a cold answer that was looked for everywhere


class Repeated:
    """Solves over a session, which the first solve opens, and a later one where the pattern is another or it has ended.

    A small problem is searched everywhere each time, as by a first solve: the last answer's branch may no longer be the
    best one. The option max_small_problem_nodes=0 leaves that out.

    server: as in solve; a Client stays open. options: of the solver, by name.
    """

    def __init__(self, server: str | Sequence[str] | Client | None = None,
                 options: Mapping[str, Any] | None = None) -> None:
        self._given, self.options = server, dict(options or {})
        self._client: Client | None = None
        self._session: Session | None = None
        self._searches = False  # whether a cold solve of this problem looks everywhere

    def solve(self, problem: LCQP, *, same_pattern: bool, z0: ArrayLike | None = None, cold: bool = False) -> Solution:
        """The answer; only numbers that differ from the last call's are sent, and the solve starts from its answer.

        same_pattern: whether the problem has the sizes and patterns of the last one, and options are the same. z0:
        start here instead. cold: forget the last answer.
        """
        if self._session is not None and same_pattern and self._session.is_open:
            try:
                answer = self._session.update(problem, z0=z0, cold=cold)
                if z0 is None and not cold and self._searches and not answer.proved:
                    return self._better(answer, self._session.update(cold=True))
                return answer
            except Aborted:  # it was idle for too long
                pass
        self.close_session()
        if self._client is None:
            self._client = self._given if isinstance(self._given, Client) else Client(server_of(self._given))
        self._session = self._client.session(problem.replaced(z0=None if z0 is None else vector(z0, "z0", problem.n)),
                                             options=self.options)
        answer = self._session.update()
        self._searches = _SEARCHED in answer.detail
        return answer

    @staticmethod
    def _better(warm: Solution, cold: Solution) -> Solution:
        takes_cold = cold.proved or not warm.solved or cold.objective <= warm.objective
        return cold if cold.solved and takes_cold else warm

    def close_session(self) -> None:
        """Ends the session, so that the next solve opens one."""
        if self._session is not None:
            self._session.close()
            self._session = None

    def close(self) -> None:
        """Ends the session, and the connection unless it was given."""
        self.close_session()
        if self._client is not None and self._client is not self._given:
            self._client.close()
        self._client = None
