"""Which Debian packages are linked with, and which are compiled in: for wheels, bills of materials and their tests."""

import functools
import pathlib
import re
import subprocess

# Headers and archives, by the packages whose copyright files give their licences: docs/DEPENDENCIES.md.
COMPILED_IN = ("libamplsolver-dev", "libeigen3-dev", "libexpected-dev", "libcli11-dev", "nlohmann-json3-dev",
               "libtomlplusplus-dev", "libjs-chart.js")


def run(*command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True).stdout


@functools.cache
def package_of(path):
    """The package that has a file, or None; /lib and /usr/lib are one folder."""
    real = str(pathlib.Path(path).resolve())
    for name in dict.fromkeys((str(path), real, str(path).removeprefix("/usr"), real.removeprefix("/usr"))):
        done = subprocess.run(["dpkg", "-S", name], capture_output=True, text=True)
        if done.returncode == 0:
            return done.stdout.partition(":")[0]
    return None


@functools.cache
def facts_of(package):
    """(source package, version, architecture) of a package that is installed."""
    return tuple(run("dpkg-query", "-W", "-f", "${source:Package} ${Version} ${Architecture}\n", package).splitlines()[0].split())


@functools.cache
def system_libraries():
    """{soname: path}, the first that the loader finds."""
    listed = re.findall(r"^\t(\S+) \(libc6,[^)]*\) => (\S+)$", run("/sbin/ldconfig", "-p"), re.MULTILINE)
    return dict(reversed(listed))


@functools.cache
def needed(path):
    """Names of the libraries that a program or library is linked with."""
    return tuple(re.findall(r"\(NEEDED\).*\[(.*)\]", run("readelf", "--wide", "--dynamic", path)))


def is_linked(path):
    """Whether a file is a program or a shared library."""
    with pathlib.Path(path).open("rb") as file:
        head = file.read(18)
    return head[:4] == b"\x7fELF" and head[16] in (2, 3)  # ET_EXEC and ET_DYN
