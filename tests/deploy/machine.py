"""A tree with its own systemd as first process: the real thing, without a container engine.

It has a network with nothing but loopback, its own processes and mounts, and a control group below ours."""

import os
import subprocess
import time
from pathlib import Path

from tree import CLEAN

GROUP = "marble-test"


def own_group():
    """A new group below this process's in the hierarchy that systemd uses, and how that is mounted; None without one."""
    for line in Path("/proc/self/cgroup").read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "name=systemd":
            mount, root = ["-t", "cgroup", "-o", "none,name=systemd"], "/sys/fs/cgroup/systemd"
        elif controllers == "" and os.path.exists("/sys/fs/cgroup/cgroup.controllers"):
            mount, root = ["-t", "cgroup2"], "/sys/fs/cgroup"
        else:
            continue
        group = Path(root + path) / f"{GROUP}-{os.getpid()}-{time.monotonic_ns()}"
        try:
            group.mkdir()
        except OSError:
            return None
        return group, mount, "systemd" if controllers else ""
    return None


BOOT = r"""
set -e
tree=$1 hierarchy=$2
shift 2
mount --bind "$tree" "$tree"
mount -t proc proc "$tree/proc"
mount --bind /sys "$tree/sys"
mount -o remount,bind,ro "$tree/sys"
mount -t tmpfs tmpfs "$tree/sys/fs/cgroup"
mkdir -p "$tree/sys/fs/cgroup/$hierarchy"
mount "$@" group "$tree/sys/fs/cgroup/$hierarchy"
for place in run tmp; do mount -t tmpfs tmpfs "$tree/$place"; done
mount --bind "$tree/proc/sys" "$tree/proc/sys"
mount -o remount,bind,ro "$tree/proc/sys"
cd "$tree"
pivot_root . mnt
umount -l /mnt
exec env -i container=marble-test PATH=/usr/sbin:/usr/bin:/sbin:/bin /lib/systemd/systemd --system --unit=basic.target \
  --log-target=null
"""


class Machine:
    """Boots at once; `running` is false where this machine allows no such thing, and `why` says what was missing."""

    def __init__(self, tree):
        self.tree, self.running, self.why, self.process, self.group = tree, False, "", None, None
        own = own_group()
        if own is None:
            self.why = "no control group can be made"
            return
        self.group, mount, hierarchy = own
        enter = f"echo $$ > '{self.group}/cgroup.procs'; exec unshare --cgroup --mount --propagation private --pid --fork " \
                f"--kill-child --net --uts --ipc sh -c \"$0\" sh \"$@\""
        self.process = subprocess.Popen(["sh", "-c", enter, BOOT, str(tree.root), hierarchy, *mount], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        end = time.monotonic() + 60
        while time.monotonic() < end and self.process.poll() is None:
            state = self.ask("systemctl", "is-system-running").stdout.strip()
            if state in ("running", "degraded"):
                self.running = True
                subprocess.run(["nsenter", f"--target={self.first()}", "--net", "ip", "link", "set", "lo", "up"], check=True)
                return
            time.sleep(0.2)
        self.why = "systemd did not start as first process"
        if self.process.poll() is not None:
            self.why += ": " + self.process.stdout.read().decode(errors="replace").strip()

    def first(self):
        """Its systemd, as a process here."""
        children = subprocess.run(["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True).stdout.split()
        return children[0] if children else str(self.process.pid)

    def ask(self, *command, user=None):
        """The finished process."""
        who = ["setpriv", f"--reuid={user}", f"--regid={user}", "--init-groups"] if user else []
        return subprocess.run(["nsenter", f"--target={self.first()}", "--mount", "--net", "--pid", "--uts", "--ipc",
                               "--root", "--wd", *who, *map(str, command)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, env=CLEAN)

    def run(self, *command, user=None):
        done = self.ask(*command, user=user)
        assert done.returncode == 0, f"{command} ended with {done.returncode}: {done.stdout}{done.stderr}"
        return done.stdout

    def close(self):
        if self.process is not None:
            self.process.kill()  # --kill-child ends the first process, and with it all of them
            self.process.wait()
        if self.group is not None:
            end = time.monotonic() + 20
            while self.group.exists() and time.monotonic() < end:
                for folder, _, _ in os.walk(self.group, topdown=False):
                    try:
                        os.rmdir(folder)
                    except OSError:
                        time.sleep(0.05)
