"""Fresh Debian 12 trees: made once by debootstrap, kept as an archive in the build directory, unpacked for each test.

The mirror is the one this machine's apt uses. Everything here needs root and runs in a mount namespace of its own
(tests/deploy/run sees to both), so that mounts and processes end with the test."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

SUITE = "bookworm"
CLEAN = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LANG": "C.UTF-8", "DEBIAN_FRONTEND": "noninteractive"}
NO_DATA = {"env", "proc", "sys", "dev", "run", "tmp"}


def run(*command, **keywords):
    """What it printed; an exception with all of that if it fails."""
    done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, **keywords)
    if done.returncode != 0:
        raise AssertionError(f"{command} ended with {done.returncode}:\n{done.stdout[-6000:]}")
    return done.stdout


def debian_sources():
    """(URI, suite, component) of the Debian archives that apt knows here, the suite itself first."""
    listing = run("apt-get", "indextargets", "--format", "$(CODENAME) $(REPO_URI) $(COMPONENT)", "Identifier: Packages",
                  "Origin: Debian")
    found = {tuple(line.split()) for line in listing.splitlines()}
    sources = sorted((codename, uri, component) for codename, uri, component in found if codename.startswith(SUITE))
    return [(uri, codename, component) for codename, uri, component in sources]


def apt_proxy():
    return [line for line in run("apt-config", "dump").splitlines()
            if line.startswith(("Acquire::http::Proxy", "Acquire::https::Proxy"))]


class Store:
    """What is kept between runs: the archive of the plain tree, and downloaded packages."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.archives = self.folder / "archives"
        self.base = self.folder / f"{SUITE}.tar"
        (self.archives / "partial").mkdir(parents=True, exist_ok=True)

    def make_base(self):
        """debootstrap, unless the archive is there."""
        if self.base.exists():
            return
        sources = debian_sources()
        if not sources:
            raise RuntimeError(f"apt knows no archive of {SUITE}")
        with tempfile.TemporaryDirectory(prefix="marble-tree-") as folder:  # debootstrap knows no paths with a space
            root, cache = Path(folder) / "root", Path(folder) / "archives"
            cache.symlink_to(self.archives.resolve())
            run("debootstrap", "--variant=minbase", f"--cache-dir={cache}", SUITE, root, sources[0][0])
            (root / "etc/apt/sources.list").write_text("".join("deb {} {} {}\n".format(*source) for source in sources))
            (root / "etc/apt/apt.conf.d/10proxy").write_text("".join(line + "\n" for line in apt_proxy()))
            shutil.copy("/etc/resolv.conf", root / "etc/resolv.conf")
            run("chroot", root, "apt-get", "update", env=CLEAN)
            part = self.base.with_suffix(".part")
            run("tar", "-C", root, "-cf", part, ".")
            part.rename(self.base)

    def tree(self):
        return Tree(self)


class Tree:
    def __init__(self, store):
        self.folder = tempfile.TemporaryDirectory(prefix="marble-tree-")
        self.root = Path(self.folder.name) / "root"
        self.root.mkdir()
        run("tar", "-C", self.root, "-xf", store.base)
        shutil.copy("/etc/resolv.conf", self.root / "etc/resolv.conf")
        # It need not survive a power cut.
        (self.root / "etc/dpkg/dpkg.cfg.d/unsafe-io").write_text("force-unsafe-io\n")
        (self.root / "etc/apt/apt.conf.d/20plain").write_text('APT::Get::Assume-Yes "true";\nAPT::Install-Recommends "false";\n')
        self.mounts = []
        self.mount("-t", "proc", "proc", at="proc")
        self.mount("--rbind", "/dev", at="dev")
        self.mount("--bind", store.archives.resolve(), at="var/cache/apt/archives")

    def mount(self, *arguments, at):
        run("mount", *arguments, self.root / at)
        self.mounts.append(self.root / at)

    def close(self):
        for place in reversed(self.mounts):
            run("umount", "--recursive", "--lazy", place)
        self.folder.cleanup()

    def command(self, *command, user=None):
        return ["chroot", *([f"--userspec={user}:{user}"] if user else []), str(self.root), *map(str, command)]

    def run(self, *command, user=None, **more):
        return run(*self.command(*command, user=user), env={**CLEAN, **more})

    def install(self, *packages):
        """Names of packages, or files of this machine."""
        for name in packages:
            if isinstance(name, Path):
                shutil.copy(name, self.root / "tmp" / name.name)
        names = [f"/tmp/{name.name}" if isinstance(name, Path) else name for name in packages]
        return self.run("apt-get", "install", *names)

    def has(self, path):
        return (self.root / path.lstrip("/")).exists()

    def read(self, path):
        return (self.root / path.lstrip("/")).read_text()

    def files(self):
        """Every path but those of other file systems and temporary ones."""
        found = set()
        for folder, folders, names in os.walk(self.root):
            here = Path(folder).relative_to(self.root)
            if here == Path("."):
                folders[:] = [name for name in folders if name not in NO_DATA]
            if here == Path("var/cache/apt"):
                folders[:] = []
            found.update(str(here / name) for name in [*folders, *names])
        return found


if __name__ == "__main__":
    Store(sys.argv[1]).make_base()
