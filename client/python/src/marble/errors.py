"""The exceptions of this package, and their making from errors of gRPC and of marble._core.

A solve that ends without being solved is no error: it is a Solution whose status says so.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from marble.base import contract, tables
from marble.base.lazy import lazy

grpc: Any = lazy("grpc")

if TYPE_CHECKING:
    from marble.model.solution import Solution

Index = int | tuple[int, int] | None

# Fields that have other names in marble._core; all others have the letters of the equation.
_OF_CORE = {"initial_z": "z0",
            **{f"warm_start.{field}".replace("_l", "_L").replace("_r", "_R"): f"warm_start.{name}"
               for name, field in tables.SOLUTION_VECTORS.items() if name != field}}
# The letters of the equation, and the names of the fields of marble.v1.Problem and marble.v1.ProblemUpdate.
_LETTERS = {"constant": "c0", "initial_point.z": "z0",
            **{field.replace("_L", "_l").replace("_R", "_r"): name for field, name in _OF_CORE.items()},
            **{field: letter for letter, field in {**tables.VECTORS, **tables.MATRICES}.items()},
            **{field: letter + ".values" for letter, field in tables.VALUES.items()}}
# The same of requests for derivatives, after "sensitivity.".
_OF_SENSITIVITY = {"rows.matrix": "rows", "rows.E": "rows", "rows.proximal": "proximal", "rows.gradient": "g",
                   "rows.g": "g", "directions.numbers": "directions", "losses.weights": "losses"}
_PARTS = ("c0", "z0", *tables.VECTORS, *tables.MATRICES)


class Error(Exception):
    """Anything that this package raises. It may be pickled, and so raised in a pool of processes."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), self.args, self.__dict__)


def _remade(kind: type[Error], arguments: tuple[Any, ...], attributes: dict[str, Any]) -> Error:
    error = kind.__new__(kind, *arguments)
    error.__dict__.update(attributes)
    return error


class InvalidArgument(Error, ValueError):
    """An argument breaks a rule, as seen here or by the server.

    field: its name; of a problem's data the letter of the equation ("A", "b") or "A.values".
    index: the entry, from 0: an int, or (row, column) of a matrix, or None.
    value: the offending value as text; may be empty.
    bound: the rule.
    """

    def __init__(self, field: str, bound: str, *, index: Index = None, value: object = "") -> None:
        self.field = field
        self.index = index
        self.value = str(value)
        self.bound = bound
        super().__init__(self._text())

    def _text(self) -> str:
        place = self.field
        if isinstance(self.index, tuple):
            place += f"[{self.index[0]}, {self.index[1]}]"
        elif self.index is not None:
            place += f"[{self.index}]"
        value = f" is {self.value}:" if self.value else ":"
        return f"{place}{value} {self.bound}" if place else self.bound


class InvalidProblem(InvalidArgument):
    """The problem's data, or an update's, break a rule."""


class FailedPrecondition(Error):
    """The request does not fit the current state: a job has no result yet, a session is closed."""


class Refused(Error):
    """A limit of the server or a quota of the client is full (RESOURCE_EXHAUSTED).

    retry_after: seconds after which another try may succeed, or None where waiting does not help.
    """

    def __init__(self, message: str, retry_after: float | None = None) -> None:
        self.retry_after = retry_after
        super().__init__(message if retry_after is None else f"{message} (try again in {retry_after:g} s)")


class Unauthenticated(Error):
    """No token or certificate, or one that the server does not know."""


class PermissionDenied(Error):
    """The client's roles or its highest priority do not allow this."""


class NotFound(Error):
    """No such job: unknown, no longer kept, or not visible to the caller."""


class DeadlineExceeded(Error, TimeoutError):
    """The call's deadline passed. The server gave the solve up."""


class Cancelled(Error):
    """The call was given up, by this side or by a client that cancelled its job."""


class Aborted(Error):
    """The server ended the session because it was idle for too long."""


class Unavailable(Error, ConnectionError):
    """The server cannot be reached, is draining, or is no Marble server; or a package that a call needs is missing.

    lost: whether another try may find one, as of a server that is restarted; not of one that does not know the call.
    """

    lost = True


class ServerError(Error):
    """A bug of the server; the message carries the job's id to look for in its log."""


class AlmostSolved(UserWarning):
    """An adapter's answer is within the reduced tolerances alone: usable, and not as exact as was asked for."""


class Unsolved(Error):
    """Raised by Solution.raise_if_unsolved. solution: the answer, with the best iterate."""

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        super().__init__(f"{solution.status.value}: {solution.detail}")


_KINDS: dict[str, type[Error]] = {
    "invalid_argument": InvalidArgument,
    "failed_precondition": FailedPrecondition,
    "resource_exhausted": Refused,
    "not_found": NotFound,
    "unavailable": Unavailable,
    "cancelled": Cancelled,
    "deadline_exceeded": DeadlineExceeded,
    "permission_denied": PermissionDenied,
    "unauthenticated": Unauthenticated,
    "aborted": Aborted,
    "internal": ServerError,
}
_UNIMPLEMENTED = 12
_DETAILS = "grpc-status-details-bin"


def _in_letters(path: str) -> str:
    """"A.values" of "solve.problem.equality_matrix.values"."""
    while True:
        head, dot, tail = path.partition(".")
        if path in _LETTERS:
            return _LETTERS[path]
        if not dot or head not in ("solve", "setup", "update", "problem", "options"):
            return _LETTERS.get(head, head) + dot + tail
        path = tail


def _in_sensitivity(path: str) -> str:
    """"sensitivity.directions.A.values" of "sensitivity.directions.numbers.equality_values"."""
    start, _, rest = path.partition(".")
    if start != "sensitivity":
        return path
    place = next((name for name in _OF_SENSITIVITY if rest == name or rest.startswith(name + ".")), "")
    rest = _OF_SENSITIVITY.get(place, "") + rest[len(place):] if place else rest
    head, dot, tail = rest.partition(".")
    names = {name.partition(".")[2]: letter.partition(".")[2] for name, letter in _OF_CORE.items() if "." in name}
    names |= {name.lower(): letter for name, letter in names.items()}
    return f"sensitivity.{head}{dot}{names.get(tail, _LETTERS.get(tail, tail))}"


def _unpack(details: Any, name: str) -> Any:
    for packed in details:
        if packed.type_url.rpartition("/")[2] == name:
            return contract.message(name).FromString(packed.value)
    return None


def _invalid(status: Any) -> InvalidArgument:
    detail = _unpack(status.details, "marble.v1.Fault")
    broken = _unpack(status.details, "google.rpc.BadRequest")
    if detail is not None:
        path, index = detail.field, detail.index if detail.HasField("index") else None
        value, bound = detail.value, detail.bound
    elif broken is not None and broken.field_violations:  # of a server that knows no Fault
        path, index = broken.field_violations[0].field, None
        if indexed := re.fullmatch(r"(.*)\[(\d+)\]", path):
            path, index = indexed[1], int(indexed[2])
        value, bound = "", broken.field_violations[0].description
    else:
        return InvalidArgument("", status.message)
    if element := re.fullmatch(r"(elements\[\d+\])\.(.+)", path):  # of an array
        error = _named(element[2], index, value, bound)
        return type(error)(f"{element[1]}.{error.field}", bound, index=error.index, value=value)
    return _named(path, index, value, bound)


def _named(path: str, index: Index, value: str, bound: str) -> InvalidArgument:
    path = path.removeprefix("solve.").removeprefix("update.")
    return _of_field(_in_sensitivity(_in_letters(path)), index, value, bound)


def _of_field(field: str, index: Index, value: str, bound: str) -> InvalidArgument:
    kind = InvalidProblem if field.partition(".")[0] in _PARTS else InvalidArgument
    return kind(field, bound, index=index, value=value)


def from_core(code: str, field: str, index: int, value: str, bound: str, sentence: str) -> Error:
    """The exception of an error of the solver in this process, by the name of its code."""
    if code == "invalid_argument":
        return _of_field(_in_sensitivity(_OF_CORE.get(field, field)), None if index < 0 else index, value, bound)
    return _KINDS[code](sentence)


def from_status(status: Any) -> Error:
    """The exception of a google.rpc.Status."""
    kind = _KINDS[tables.ERRORS.get(status.code, "internal")]
    if kind is InvalidArgument:
        return _invalid(status)
    if kind is Refused:
        retry = _unpack(status.details, "google.rpc.RetryInfo")
        if retry is None or _is_too_large(_unpack(status.details, "marble.v1.Fault")):
            return Refused(status.message)
        return Refused(status.message, retry.retry_delay.seconds + 1e-9 * retry.retry_delay.nanos)
    if kind is Unavailable:
        return _unavailable(status)
    return kind(status.message)


def _is_too_large(detail: Any) -> bool:
    """Whether a refused request has more bytes than all requests may have together: waiting does not help."""
    if detail is None or detail.field not in ("queue_bytes", "client_bytes"):
        return False
    asked, most = re.match(r"(\d+) more", detail.value), re.search(r"at most (\d+) bytes", detail.bound)
    return asked is not None and most is not None and int(asked[1]) > int(most[1])


# Of a connection that was not made: what gRPC says, and what the reason may be.
_UNCONNECTED = re.compile("failed to connect to all addresses|connections to all backends failing")
_HINTS = (
    (re.compile("Socket closed|Connection reset|Broken pipe", re.I),
     "; does the server want TLS (tls=True, MARBLE_TLS_CA), or a certificate of the client (MARBLE_TLS_CERTIFICATE)?"),
    (re.compile("wrong.version.number", re.I),
     "; does the server speak without TLS? This client uses it (tls, tls_ca, MARBLE_TLS_CA)"),
    (re.compile("certificate.verify.failed", re.I), "; tls_ca or MARBLE_TLS_CA names who vouches for the server"),
)


def _hint(message: str) -> str:
    if tables.DEFAULT_ADDRESS in message and "Connection refused" in message:
        return tables.NO_SERVER_HINT + tables.LOCAL_HINT
    if not _UNCONNECTED.search(message):
        return ""
    return next((hint for pattern, hint in _HINTS if pattern.search(message)), "")


def _unavailable(status: Any) -> Unavailable:
    error = Unavailable(status.message + _hint(status.message))
    if status.code == _UNIMPLEMENTED:
        error.lost = False
    return error


def from_rpc(error: grpc.RpcError) -> Error:
    """The exception of a call that failed."""
    status = contract.message("google.rpc.Status")()
    for key, value in error.trailing_metadata() or ():
        if key == _DETAILS:
            try:
                status.MergeFromString(value)
            except Exception:  # an intermediary's; protobuf's versions differ in the class
                status.Clear()
    status.code = error.code().value[0]
    status.message = error.details() or ""
    return from_status(status)
