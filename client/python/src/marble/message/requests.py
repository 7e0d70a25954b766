"""Messages to a server, checked and encoded."""

from __future__ import annotations

import dataclasses
import difflib
import math
import numbers
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from marble.base import contract
from marble.base.checks import is_number
from marble.base.tables import LARGEST_PAGE, LONGEST_REQUEST_ID, MATRICES, SOLUTION_VECTORS, VECTORS
from marble.errors import InvalidArgument
from marble.message import sensitivity
from marble.message.job import JobState, Priority
from marble.message.wire import Encoder
from marble.model import derivatives
from marble.model.derivatives import SensitivityRequest
from marble.model.lcqp import LCQP, shortened
from marble.model.solution import Solution

# Names in other solvers that resemble none of this package's.
_ELSEWHERE: Final = {
    "timeout": ("deadline", "time_limit_s"), "verbose": ("progress",), "x0": ("z0",),
    "starts": ("num_starts",), "global": ("global_search",), "global_": ("global_search",),
    **dict.fromkeys(("gap_tol", "rel_gap", "mip_gap", "mipgap"), ("relative_gap_tolerance",)),
    **dict.fromkeys(("tol", "eps", "tolerance"),
                    ("equality_tolerance", "inequality_tolerance", "complementarity_tolerance",
                     "stationarity_tolerance"))}
_MOST_GUESSES: Final = 3


def check_request_id(request_id: str) -> None:
    """At most 128 bytes of printable ASCII."""
    if not (isinstance(request_id, str) and len(request_id) <= LONGEST_REQUEST_ID and request_id.isascii()
            and request_id.isprintable()):
        raise InvalidArgument("request_id", f"must be at most {LONGEST_REQUEST_ID} bytes of printable ASCII")


def priority_number(priority: Priority | str | None) -> int:
    """Of marble.v1.Priority; None is the method's own."""
    if priority is None:
        return 0
    try:
        return contract.enum_numbers("Priority")[Priority(priority).value]
    except ValueError:
        rule = "must be realtime, interactive or batch"
        raise InvalidArgument("priority", rule, value=repr(priority)) from None


def _check_options(options: object) -> None:
    if options is not None and not isinstance(options, Mapping):
        raise InvalidArgument("options", "must be a mapping of names to values", value=type(options).__name__)


def _unknown(name: str, others: Iterable[str] = ()) -> InvalidArgument:
    """The error of an unknown option, with the options or other names that may have been meant."""
    known = [*dict.fromkeys((*contract.message("SolveOptions").DESCRIPTOR.fields_by_name, *others))]
    near = [one for one in _ELSEWHERE.get(name.lower(), ()) if one in known]
    near = near or difflib.get_close_matches(name.lower(), known, _MOST_GUESSES)
    if near:
        return InvalidArgument(name, f"is no option; did you mean {' or '.join(near)}?")
    return InvalidArgument(name, "is no option; core/OPTIONS.md has all, and so has Client.info().options")


def merged(options: Mapping[str, Any] | None, by_name: Mapping[str, Any],
           others: Iterable[str] = ()) -> Mapping[str, Any] | None:
    """The options of a call that takes them in a mapping and by their names; a name overrides the mapping.

    others: names of the call's own arguments, which an unknown name may have meant.
    """
    _check_options(options)
    if not by_name:
        return options
    known = contract.message("SolveOptions").DESCRIPTOR.fields_by_name
    for name in by_name:
        if name not in known:
            raise _unknown(name, (*ARGUMENTS, *others))
    return {**(options or {}), **by_name}


def options_message(options: Mapping[str, Any] | None) -> Any:
    """SolveOptions by name. The server checks the ranges of the values."""
    message = contract.message("SolveOptions")()
    _check_options(options)
    for name, value in (options or {}).items():
        if not isinstance(name, str):
            raise InvalidArgument("options", "must have strings as names", value=repr(name))
        field = message.DESCRIPTOR.fields_by_name.get(name)
        if field is None:
            raise _unknown(name)
        if field.enum_type is not None:
            value = _choice(name, value, field.enum_type)
        try:
            if field.type == field.TYPE_DOUBLE:
                value = float(value)
            elif field.type == field.TYPE_INT32 and not isinstance(value, bool) and int(value) == value:
                value = int(value)
            setattr(message, name, value)
        except (OverflowError, TypeError, ValueError) as error:
            raise InvalidArgument(name, f"has the wrong type ({error})", value=repr(value)) from None
    return message


def _choice(name: str, value: object, kind: Any) -> int:
    choices = {text: number for number, text in contract.enum_names(kind.name).items() if number}
    if value not in choices:
        raise InvalidArgument(name, f"must be one of {', '.join(choices)}", value=repr(value))
    return choices[str(value)]


def matrix_encoder(values: Any) -> Encoder:
    """A SparseMatrix."""
    part = Encoder("SparseMatrix")
    part.others(contract.message("SparseMatrix")(rows=values.shape[0], columns=values.shape[1]))
    part.integers("column_pointers", values.indptr)
    part.integers("row_indices", values.indices)
    part.doubles("values", values.data)
    return part


def problem_encoder(problem: LCQP) -> Encoder:
    """A Problem; Q is its upper triangle."""
    part = Encoder("Problem")
    part.others(contract.message("Problem")(name=problem.name, constant=problem.c0, hessian_form=2))
    for letter, field in MATRICES.items():
        values = getattr(problem, letter)
        if values.shape[0] and (letter != "Q" or values.nnz):
            part.message(field, matrix_encoder(values))
    for letter, field in VECTORS.items():
        part.doubles(field, getattr(problem, letter))
    return part


def initial_point(z0: Any) -> Encoder:
    """An InitialPoint."""
    part = Encoder("InitialPoint")
    part.doubles("z", z0)
    return part


def check_sensitivity(request: object) -> None:
    """A SensitivityRequest or None."""
    if not (request is None or isinstance(request, SensitivityRequest)):
        raise InvalidArgument("sensitivity", "must be a SensitivityRequest", value=type(request).__name__)


def sensitivity_encoder(request: SensitivityRequest, problem: LCQP) -> Encoder:
    """A SensitivityRequest of this problem."""
    return sensitivity.encoder(derivatives.asked(request, problem), matrix_encoder)


ANSWER_GRACE_S: Final = 0.1
_LONGEST_GRACE_S: Final = 3600


@dataclass(frozen=True)
class Call:
    """What accompanies one solve.

    options: solver options by name. priority: None is the method's own. request_id: for the server's log; at most 128
    bytes of printable ASCII. progress_interval: least time between two reports, seconds, ≥ 0; 0 reports every
    iteration. iterate_every: Progress.z is set in every k-th report, if it is the newest when it is sent; 0 never.
    warm_start: a solution of this problem or one like it, of the same sizes: its branch is tried before anything else.
    sensitivity: derivatives of the solution to compute with it. answer_grace: of a session.
    """

    options: Mapping[str, Any] | None = None
    priority: Priority | str | None = None
    request_id: str = ""
    progress_interval: float = 0.0
    iterate_every: int = 0
    warm_start: Solution | None = None
    sensitivity: SensitivityRequest | None = None
    answer_grace: float = ANSWER_GRACE_S

    def __post_init__(self) -> None:
        check_sensitivity(self.sensitivity)
        if not (self.warm_start is None or isinstance(self.warm_start, Solution)):
            raise InvalidArgument("warm_start", "must be a Solution", value=type(self.warm_start).__name__)


ARGUMENTS: Final = (*(field.name for field in dataclasses.fields(Call)), "progress", "deadline")


def _warm_start(start: Solution) -> Encoder:
    part = Encoder("WarmStart")
    for name, field in SOLUTION_VECTORS.items():
        part.doubles(field, getattr(start, name))
    part.others(contract.message("WarmStart")(reference_objective=start.reference_objective))
    return part


def _solve(problem: LCQP | str | None, call: Call, base: LCQP | None = None, /, **parts: Encoder) -> Encoder:
    """A SolveRequest; of a problem of which there is a name alone, or of an update of `base`, with further parts."""
    check_request_id(call.request_id)
    part = Encoder("SolveRequest")
    known = problem if isinstance(problem, LCQP) else base
    named = {"problem": {"name": shortened(problem)}} if isinstance(problem, str) else {}
    if isinstance(problem, LCQP):
        part.message("problem", problem_encoder(problem))
    part.others(contract.message("SolveRequest")(options=options_message(call.options), request_id=call.request_id,
                                                 priority=priority_number(call.priority), **named))
    if known is not None and known.z0 is not None:
        part.message("initial_point", initial_point(known.z0))
    if call.warm_start is not None:
        part.message("warm_start", _warm_start(call.warm_start))
    for field, inner in parts.items():
        part.message(field, inner)
    if known is not None and call.sensitivity is not None:
        part.message("sensitivity", sensitivity_encoder(call.sensitivity, known))
    return part


def solve(problem: LCQP, call: Call) -> bytes:
    """A SolveRequest."""
    return _solve(problem, call).finish()


def _named(call: Call) -> Call:
    return call if call.request_id else dataclasses.replace(call, request_id=f"submit-{uuid.uuid4()}")


def submission(problem: LCQP | str, call: Call, **parts: Encoder) -> bytes:
    """A SolveRequest with a request id: one submission, however often it is sent. parts: scenarios or coupled."""
    return _solve(problem, _named(call), **parts).finish()


def check_progress(call: Call) -> None:
    """The interval is a time and the iterates a count."""
    interval = call.progress_interval
    if not (is_number(interval) and math.isfinite(interval) and interval >= 0):
        raise InvalidArgument("progress_interval", "must be finite and >= 0", value=interval)
    if not (isinstance(call.iterate_every, numbers.Integral) and 0 <= call.iterate_every < 2**31):
        raise InvalidArgument("iterate_every", "must be a whole number in [0, 2**31)", value=call.iterate_every)


def check_session(call: Call) -> None:
    """What only a session has, and its progress."""
    check_progress(call)
    if not (is_number(call.answer_grace) and 0 <= call.answer_grace <= _LONGEST_GRACE_S):
        raise InvalidArgument("answer_grace", f"must be in [0, {_LONGEST_GRACE_S}] seconds", value=call.answer_grace)


def solve_stream(problem: LCQP | str, call: Call, **parts: Encoder) -> bytes:
    """A SolveStreamRequest. problem: the name alone of blocks. parts: scenarios or coupled."""
    check_progress(call)
    part = Encoder("SolveStreamRequest")
    part.message("solve", _solve(problem, call, **parts))
    part.others(contract.message("SolveStreamRequest")(progress_interval_s=call.progress_interval,
                                                       iterate_every=call.iterate_every))
    return part.finish()


def array_setup(base: LCQP | None, name: str, call: Call) -> bytes:
    """The first SubmitArrayRequest: what all elements share."""
    named = _named(call)
    check_request_id(named.request_id)
    part = Encoder("ArraySetup")
    if base is not None:
        part.message("problem", problem_encoder(base))
    part.others(contract.message("ArraySetup")(options=options_message(call.options), request_id=named.request_id,
                                               priority=priority_number(call.priority), name=shortened(name)))
    whole = Encoder("SubmitArrayRequest")
    whole.message("setup", part)
    return whole.finish()


def array_element(problem: LCQP | None, update: Encoder | None, base: LCQP | None, call: Call) -> bytes:
    """A further one: an element with a problem of its own, or with new numbers for the base problem."""
    part = Encoder("ArrayElement")
    part.message("solve", _solve(problem, call, None if problem is not None else base))
    if update is not None:
        part.message("update", update)
    whole = Encoder("SubmitArrayRequest")
    whole.message("element", part)
    return whole.finish()


def array_end(elements: int) -> bytes:
    """The last one."""
    data: bytes = contract.message("SubmitArrayRequest")(end={"elements": elements}).SerializeToString()
    return data


def batch(tag: int, problem: LCQP, call: Call) -> bytes:
    """A SolveBatchRequest."""
    part = Encoder("SolveBatchRequest")
    part.others(contract.message("SolveBatchRequest")(tag=tag))
    part.message("solve", _solve(problem, call))
    return part.finish()


def job(kind: str, job_id: str, **fields: Any) -> bytes:
    """A request about one job: JobResultRequest, GetJobRequest, …"""
    if not isinstance(job_id, str):
        raise InvalidArgument("job_id", "must be a string", value=repr(job_id))
    job_id = job_id.encode(errors="replace").decode()
    data: bytes = contract.message(kind)(job_id=job_id, **fields).SerializeToString()
    return data


def list_jobs(states: tuple[JobState | str, ...], client: str, limit: int, before: str) -> bytes:
    """A ListJobsRequest."""
    if not 0 <= limit <= LARGEST_PAGE:
        raise InvalidArgument("limit", f"must be in [0, {LARGEST_PAGE}]", value=limit)
    numbers = contract.enum_numbers("JobState")
    data: bytes = contract.message("ListJobsRequest")(
        states=[numbers[JobState(state).value] for state in states], client=client, limit=limit,
        before_job_id=before).SerializeToString()
    return data
