"""python -m marble demo | solve FILE… | convert IN OUT | info | server."""

from __future__ import annotations

import argparse
import os
import pathlib
import sys
from collections.abc import Sequence
from typing import Any

from marble import drawing, flights, programs, robots
from marble.base.tables import DEFAULT_ADDRESS
from marble.client import Client
from marble.errors import Error, InvalidArgument
from marble.hopper import Hopper
from marble.model.problem import Problem

_SOLVED, _NOT_SOLVED, _USAGE, _SERVER = 0, 1, 2, 3
_DEMOS = ("hopper", "rocket", "gates")
_BENT = "nonlinear-"  # before the name of a robot


def _value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return {"true": True, "false": False}.get(text, text)


def _options(texts: Sequence[str]) -> dict[str, Any]:
    pairs = [text.partition("=") for text in texts]
    for name, equals, _ in pairs:
        if not equals:
            raise InvalidArgument("option", "must be NAME=VALUE", value=name)
    return {name: _value(value) for name, _, value in pairs}


def _plan(client: Client, arguments: argparse.Namespace) -> int:
    """A robot whose formulas bend: a picture and a moving one, or the one that is asked for."""
    name = os.path.basename(arguments.name).partition(".")[0]
    kind = robots.ROBOTS.get(name.removeprefix(_BENT))
    if kind is None:
        raise InvalidArgument("demo", f"must be one of {', '.join(_BENT + each for each in robots.ROBOTS)}", value=name)
    plan = robots.solve(kind().robot(), server=client, progress=print if arguments.progress else None)
    print(plan)
    files = [arguments.picture or arguments.name] if arguments.picture or arguments.name != name else \
        [f"{name}.png", f"{name}.gif"]
    try:
        for file in files:
            robots.save(plan, file)
        print(f"\ndrawn in {' and '.join(files)}")
    except ImportError:
        print("\nwith matplotlib and pillow installed this is a picture")
    return _SOLVED if plan.answer.solved else _NOT_SOLVED


def _demo(client: Client, arguments: argparse.Namespace) -> int:
    name, picture = arguments.name, arguments.picture
    if os.path.basename(name).startswith(_BENT):
        return _plan(client, arguments)
    if name not in _DEMOS:  # a file alone
        stem = os.path.basename(name).partition(".")[0]
        name, picture = stem if stem in _DEMOS else "hopper", name
    picture = picture or f"{name}.png"
    hopper = Hopper()
    answer = client.solve(hopper.problem() if name == "hopper" else flights.problem(name), progress=arguments.progress)
    print(answer)
    try:
        if name == "hopper":
            drawing.save(hopper, answer.z, picture)
        else:
            flights.save(name, answer.z, picture)
        print(f"\ndrawn in {picture}")
    except ImportError:
        if name == "hopper":
            print("\n" + drawing.text(hopper, answer.z))
        print("\nwith matplotlib installed this is a picture")
    return _SOLVED if answer.solved else _NOT_SOLVED


def _solve(client: Client, arguments: argparse.Namespace) -> int:
    code = _SOLVED
    for path in arguments.files:
        try:
            problem = Problem.load(path)
        except (OSError, InvalidArgument) as error:
            print(f"marble: {path}: {error}", file=sys.stderr)
            code = max(code, _USAGE)
            continue
        answer = client.solve(problem, options=_options(arguments.option), progress=arguments.progress)
        print(answer.replaced(objective=0 - answer.objective, bound=0 - answer.bound) if problem.negated else answer)
        code = max(code, _SOLVED if answer.solved else _NOT_SOLVED)
    return code


def _convert(arguments: argparse.Namespace) -> int:
    path = arguments.input
    try:
        problem = Problem.load(path)
        path = arguments.output
        if pathlib.Path(path).suffix != ".json":
            raise InvalidArgument("", "must end in .json, which `marble convert` converts to other formats")
        if problem.negated:
            print(f"marble: {path}: is a maximum: its negative is minimized", file=sys.stderr)
        problem.save(path)
    except (OSError, InvalidArgument) as error:
        print(f"marble: {path}: {error}", file=sys.stderr)
        return _USAGE
    return _SOLVED


def _info(client: Client, _: argparse.Namespace) -> int:
    info = client.info()
    print(f"marble-server {info.version} at {client.address}: {info.workers} workers, up {info.uptime_s:.0f} s")
    print(f"you are {info.client or 'unauthenticated'}, and may {', '.join(info.roles)}")
    for title, numbers in (("limits", info.limits), ("counters", info.counters)):
        print(f"{title}:")
        for name, number in numbers.items():
            print(f"  {name:<30} {number:g}" if isinstance(number, float) else f"  {name:<30} {number}")
    return _SOLVED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m marble", description=__doc__,
                                     epilog="exit codes: 0 all solved, 1 some not solved, 2 usage or bad file, "
                                            "3 server unreachable or refused")
    parser.add_argument("--server", help="host:port, unix:PATH, or local for this process; default MARBLE_SERVER, "
                                          f"else {DEFAULT_ADDRESS}")
    commands = parser.add_subparsers(required=True)
    demo = commands.add_parser("demo", help="solve one of the paper's problems and draw it")
    demo.add_argument("name", nargs="?", default="hopper",
                      help="hopper, rocket or gates; nonlinear-rocket, -quadrotor, -hopper or -pusher, by casadi; or "
                           "just the file, rocket.png")
    demo.add_argument("picture", nargs="?", help="the file to draw into, NAME.png; of the hopper and of the nonlinear "
                                                 "ones .gif is an animation")
    demo.set_defaults(run=_demo)
    solve = commands.add_parser("solve", help="solve problem files: JSON, .mat, and with highspy MPS, QPS and LP")
    solve.add_argument("files", nargs="+", metavar="FILE")
    solve.add_argument("--option", action="append", default=[], metavar="NAME=VALUE", help="a solver option")
    solve.set_defaults(run=_solve)
    for command in (demo, solve):
        command.add_argument("--progress", action="store_true", help="show progress")
    convert = commands.add_parser("convert", help="convert a problem file that solve reads to JSON; without a server")
    convert.add_argument("input", metavar="IN", help="problem.mat (LCQPow's names; of MATLAB 7.3 with h5py), …")
    convert.add_argument("output", metavar="OUT", help="problem.json")
    convert.set_defaults(run=_convert)
    commands.add_parser("info", help="what the server is").set_defaults(run=_info)
    commands.add_parser("server", add_help=False, help="run a marble-server; its own arguments follow")
    return parser


def main(texts: Sequence[str] | None = None) -> int:
    """Runs a command; returns its exit code."""
    words = list(sys.argv[1:] if texts is None else texts)
    try:
        if words[:1] == ["server"]:
            programs.run("marble-server", words[1:])
        arguments = _parser().parse_args(words)
        if arguments.run is _convert:
            return _convert(arguments)
        with Client(arguments.server) as client:
            code: int = arguments.run(client, arguments)
            return code
    except BrokenPipeError:  # the reader has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _SOLVED
    except InvalidArgument as error:
        print(f"marble: {error}", file=sys.stderr)
        return _USAGE
    except Error as error:
        print(f"marble: {error}", file=sys.stderr)
        return _SERVER


if __name__ == "__main__":
    sys.exit(main())
