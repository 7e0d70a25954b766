"""The work of fresh-tree: a tree, the project's files in it, and the command."""

import subprocess
import sys

from tree import CLEAN, Store

root, trees, command = sys.argv[1:]
store = Store(trees)
store.make_base()
tree = store.tree()
try:
    (tree.root / "marble").mkdir()
    files = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True).stdout
    packed = subprocess.run(["tar", "--null", "--files-from=-", "-c"], cwd=root, input=files, capture_output=True, check=True).stdout
    subprocess.run(["tar", "-x", "-C", tree.root / "marble"], input=packed, check=True)
    done = subprocess.run(tree.command("sh", "-c", f"cd /marble && {command}"), stdin=subprocess.DEVNULL, env=CLEAN)
finally:
    tree.close()
sys.exit(done.returncode)
