"""Problems to marble._core, which is core itself, and its answers back; the same classes as a server's."""

from __future__ import annotations

import contextlib
import functools
import importlib
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final, NoReturn

import numpy as np

from marble import errors
from marble.base.tables import Status
from marble.calls.batch import BatchAnswer, BatchItem
from marble.connection.rpc import check_deadline
from marble.errors import Cancelled, Error, Unavailable
from marble.in_process.ending import under_way
from marble.message import answers, requests
from marble.message.requests import Call
from marble.model import derivatives
from marble.model.conflict import Conflict
from marble.model.derivatives import SensitivityAnswer
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled, in_terms_of
from marble.model.solution import PointOrigin, Progress, SecondOrder, Solution, Stationarity, Times, Violations

IN_PROCESS: Final = "in process"
SHOWN_EVERY_S: Final = 0.5
_VECTORS: Final = ("z", "y", "nu", "xi", "eta", "certificate")
_STATUSES: Final = {status.value: status for status in Status}
_STATIONARITIES: Final = {kind.value: kind for kind in Stationarity}
_SECOND_ORDERS: Final = {kind.value: kind for kind in SecondOrder}


@functools.cache
def core() -> Any:
    """marble._core; Unavailable where the package was built without it."""
    try:
        return importlib.import_module("marble._core")
    except ImportError as error:
        raise Unavailable(
            "this build of marble has no solver of its own (marble._core): install a wheel of marble-solver, or build "
            f"with pybind11; or name a server (MARBLE_SERVER=HOST:PORT) ({error})") from None


@contextlib.contextmanager
def faults() -> Iterator[None]:
    """What core raises within is raised as this package's error."""
    try:
        yield
    except core().Fault as fault:
        raise errors.from_core(*fault.args) from None


@contextlib.contextmanager
def showing(stop: Any, tell: Any) -> Iterator[None]:
    """While it lasts, a method `show` of what takes the rows is given twice a second, in words, what the solve does."""
    show = getattr(tell, "show", None)
    if show is None:
        yield
        return
    over = threading.Event()

    def watch(shows: Callable[[str], object]) -> None:
        while not over.wait(SHOWN_EVERY_S):
            shows(stop.activity())

    watcher = threading.Thread(target=watch, args=(show,), name="marble-activity", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


class NoServer:
    """In the place of a connection: what asks for a server is told that there is none."""

    def call(self, *_: Any, **__: Any) -> NoReturn:
        """There is nobody to call."""
        raise Unavailable(f"there is no server: this client solves {IN_PROCESS} (local)")

    stream = tries = duplex = call


def option_values(options: Mapping[str, Any] | None) -> dict[str, Any]:
    """The options by their names, checked by the contract as for a server."""
    return answers.options(requests.options_message(options)) if options else {}


def _row(tell: Callable[[Progress], object]) -> Callable[..., None]:
    def told(iteration: int, outer_iteration: int, objective: float, violations: tuple[float, float, float],
             *rest: Any) -> None:
        *numbers, z, incumbent, bound, gap, nodes, open_nodes = rest
        row = [*numbers, np.asarray(z), incumbent, bound, gap, nodes, open_nodes]
        tell(Progress(iteration, outer_iteration, objective, Violations(*violations), *row))

    return told


def core_call(problem: LCQP, call: Call, tell: Callable[[Progress], object] | None, deadline: float | None,
              stop: Any) -> Any:
    """What accompanies one solve, checked. stop: a Stop of core."""
    if call.request_id:
        requests.check_request_id(call.request_id)
    if call.priority is not None:
        requests.priority_number(call.priority)
    requests.check_progress(call)
    main_thread = threading.get_ident() == threading.main_thread().ident
    s = call.warm_start
    start = None if s is None else (s.z, s.y, s.nu, s.xi, s.eta, s.cold_objective)
    return core().Call(check_deadline(deadline), None if tell is None else _row(tell), call.progress_interval,
                       call.iterate_every, stop, main_thread, start,
                       None if call.sensitivity is None else derivatives.asked(call.sensitivity, problem))


def _sensitivity(told: dict[str, Any] | None, n: int) -> SensitivityAnswer | None:
    if told is None:
        return None
    for name in ("error", "rows_error"):
        if (fault := told.get(name)) is not None:
            told[name] = errors.from_core(*fault)
    if told.get("rows") is not None:
        told["rows"] = derivatives.response(*(np.asarray(part, np.float64) for part in told["rows"]))
    parts = {name: {part: np.asarray(values) for part, values in told.get(name, {}).items()}
             for name in ("changes", "gradients")}
    told["changes"] = derivatives.by_part(parts["changes"], len(told.get("holds", ())))
    told["gradients"] = derivatives.by_part(parts["gradients"], parts["gradients"].get("g", np.zeros(0)).size // n)
    for name in ("weak_inequalities", "biactive_pairs", "missing_changes", "missing_gradients"):
        told[name] = np.array(told.get(name, ()), np.int32)
    told["holds"] = np.array(told.get("holds", ()), np.bool_)
    return SensitivityAnswer(**told)


def solution(parts: dict[str, Any], problem: LCQP) -> Solution:
    """The answer of core as an object of this package; of a solve that was stopped too."""
    for name in _VECTORS:
        parts[name] = np.asarray(parts[name])
    parts["status"] = _STATUSES[parts["status"]]
    parts["origin"] = PointOrigin(parts["origin"])
    parts["stationarity"] = _STATIONARITIES.get(parts["stationarity"])
    parts["second_order"] = _SECOND_ORDERS.get(parts["second_order"])
    parts["violations"] = Violations(*parts["violations"])
    parts["times"] = Times(*parts["times"])
    parts["sensitivity"] = _sensitivity(parts["sensitivity"], problem.n)
    if parts["conflict"] is not None:
        parts["conflict"] = Conflict.of(*parts["conflict"])
    return Solution(**parts, problem=problem, job_id="")


def unless_cancelled(answer: Solution) -> Solution:
    """The answer; a solve that was given up has none."""
    if answer.status is Status.CANCELLED:
        raise Cancelled("given up by the caller")
    return answer


def stoppable(problem: LCQP, call: Call, tell: Callable[[Progress], object] | None, deadline: float | None,
              stop: Any) -> Solution:
    """Solves on this thread. Whoever has `stop` ends it, with the status CANCELLED."""
    stop = stop or core().Stop()
    options, accompanied = option_values(call.options), core_call(problem, call, tell, deadline, stop)
    with faults(), under_way(stop), showing(stop, tell):
        told = core().solve(problem, options, accompanied)
    return solution(told, problem)


def solve(problem: LCQP, call: Call, tell: Callable[[Progress], object] | None = None,
          deadline: float | None = None, stop: Any = None) -> Solution:
    """Solves on this thread; on the main one Ctrl-C gives the solve up, elsewhere whoever has `stop`."""
    return unless_cancelled(stoppable(problem, call, tell, deadline, stop))


def batch(problems: Iterable[LCQP | Problem | BatchItem], call: Call) -> Iterator[BatchAnswer]:
    """One after the other, in the order in which they come."""
    for index, item in enumerate(problems):
        one = item if isinstance(item, BatchItem) else BatchItem(item)
        problem = compiled(one.problem)
        wishes = Call(call.options if one.options is None else one.options, call.priority, one.request_id,
                      sensitivity=one.sensitivity)
        try:
            answer, error = in_terms_of(one.problem, solve(problem, wishes)), None
        except Error as caught:
            answer, error = None, caught
        yield BatchAnswer(index, one.tag, answer, error)
