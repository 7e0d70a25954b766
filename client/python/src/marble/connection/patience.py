"""How long a call waits for a server that is lost or full."""

from __future__ import annotations

import logging
import math
import random
import time
from typing import Final

from marble.base.checks import is_number
from marble.base.log import logger
from marble.errors import Cancelled, DeadlineExceeded, Error, InvalidArgument, Refused, Unavailable

# Calls that change nothing on a server may be repeated, and Jobs.Submit and SubmitArray, whose request ids make two
# of them one job. Watches are repeated as long as no event was received.
REPEATABLE: Final = frozenset({
    "Solver/Solve", "Solver/SolveStream", "Solver/SolveScenarios", "Solver/SolveCoupled",
    "Jobs/Submit", "Jobs/SubmitArray", "Jobs/Result", "Jobs/ArrayResults", "Jobs/List", "Jobs/Get", "Jobs/Watch",
    "Server/GetInfo"})
# Calls that are repeated when a full server refuses them.
WAITS_WHEN_FULL: Final = frozenset({"Jobs/Submit", "Jobs/SubmitArray", "Jobs/ArrayResults"})
DEFAULT_WAIT_S: Final = 10.0
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 1.0
# A wrong address is reported within the sum of these; a connection that broke at its first call is tried again.
_FIRST_PAUSES: Final = 3
CONNECT_S: Final = 5.0  # a connection that takes longer to be made counts as lost
_SHORTEST_DELAY_S: Final = 0.01  # of a refusal


def check_wait(wait: float | None) -> float | None:
    """Seconds ≥ 0, infinity too; None is the default."""
    if wait is not None and not (is_number(wait) and wait >= 0):
        raise InvalidArgument("wait", "must be >= 0 seconds", value=wait)
    return wait


class Patience:
    """Of all calls of one client. wait: as in marble.Client."""

    def __init__(self, wait: float | None) -> None:
        self._wait = check_wait(wait)
        self.reached = False  # whether a server has ever answered

    @property
    def wait(self) -> float:
        """Seconds that a call may spend on a server that is lost."""
        return DEFAULT_WAIT_S if self._wait is None else self._wait

    @property
    def hardly(self) -> bool:
        """Whether to try only a few times: it is not known whether there is a server."""
        return self._wait is None and not self.reached


class Tries:
    """The tries of one call. deadline: seconds from now on, or None.

    lost: whether the call waits for a lost server. full: whether it waits for a full one.
    """

    def __init__(self, patience: Patience, deadline: float | None = None, *, lost: bool = True,
                 full: bool = False) -> None:
        self._patience, self._lost, self._full = patience, lost, full
        self._begun = time.monotonic()
        self._end = math.inf if deadline is None else self._begun + deadline
        self.reset()

    @staticmethod
    def of(patience: Patience, method: str, deadline: float | None) -> Tries:
        """Of a call by its name, such as Solver/Solve."""
        return Tries(patience, deadline, lost=method in REPEATABLE, full=method in WAITS_WHEN_FULL)

    def reset(self) -> None:
        """Starts anew: the server has responded, and a later loss is another one."""
        self._spent, self._failed = 0.0, 0

    def reached(self) -> None:
        """Records that a server has responded."""
        self._patience.reached = True
        self.reset()

    def left(self) -> float | None:
        """Seconds until the deadline, for the next try, which begins now; None is no deadline."""
        self._begun = time.monotonic()
        if math.isinf(self._end):
            return None
        return max(self._end - self._begun, 1e-3)  # gRPC reports that it has passed

    def pause(self, error: Error) -> float:
        """Seconds until the next try; raises the error where waiting does not help, at the end of the
        patience, and where the deadline would pass first.
        """
        if isinstance(error, Unavailable) and error.lost:
            pause = self._lost_pause(error)
        else:
            if not isinstance(error, Cancelled | DeadlineExceeded):
                self._patience.reached = True
            if not (self._full and isinstance(error, Refused) and error.retry_after is not None):
                raise error
            self.reset()
            pause = max(error.retry_after, _SHORTEST_DELAY_S)
            logger.info("the server is full; the next try is in %.2f s: %r", pause, error)
        if time.monotonic() + pause >= self._end:
            raise error
        return pause

    def _lost_pause(self, error: Error) -> float:
        if not self._lost:
            raise error
        # The first failure is of a server that was there until now. A later try that took longer than a connection may
        # has found one, which was lost in its turn.
        if self._failed > 0:
            self._spent += min(time.monotonic() - self._begun, CONNECT_S)
        pause = min(_FIRST_PAUSE_S * 2.0**min(self._failed, 10), _LONGEST_PAUSE_S)
        self._failed += 1
        if self._patience.hardly:
            if self._failed > _FIRST_PAUSES:
                raise error
        elif self._spent >= self._patience.wait:
            raise error
        pause = min(pause * random.uniform(0.8, 1.0), max(self._patience.wait - self._spent, 0.0))
        self._spent += pause
        first = self._failed == 1 and not self._patience.hardly
        logger.log(logging.WARNING if first else logging.DEBUG,
                   "a server is lost; the next try is in %.2f s, for %.1f s in all: %r", pause, self._patience.wait,
                   error)
        return pause
