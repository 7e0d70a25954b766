"""deploy/release, in a repository of its own where building and packing are stand-ins: what it refuses, and what it tags."""

import os
import pathlib
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
STANDS_IN = {
    "tests/tidy": "exit ${TIDY_FAULTS:-0}",
    "deploy/make-packages": 'touch "$1/marble-server.deb"',
    "deploy/make-sbom": 'for file in "$1"/*; do echo "{}" >"$file.cdx.json"; done',
    "deploy/make-wheels": 'touch "$1/marble_solver-manylinux.whl"',
    "programs/python3": 'touch "$6/marble_solver.whl" "$6/marble_solver.tar.gz"',
    "programs/npm": 'if [ "$1" = pack ]; then touch "$3/marble-client.tgz"; fi',
}


class Release(unittest.TestCase):
    def setUp(self):
        self.work = pathlib.Path(tempfile.mkdtemp(prefix="marble release "))
        self.addCleanup(shutil.rmtree, self.work)
        self.checkout = self.work / "checkout"
        for name, command in STANDS_IN.items():
            self.write(name, f"#!/bin/sh\n{command}\n", 0o755)
        for name in ("proto/released/marble-v1.binpb", "build/release/marble.binpb"):
            self.write(name, "the contract")
        self.write("client/ts/package.json", "{}")
        self.write("deploy/VERSION", "1.2.3\n")
        self.write("CHANGELOG.md", "# Changes\n\n## 1.2.3, 2026-01-02\n\nWhat is new.\n\n## 1.2.2, 2026-01-01\n\nOld.\n")
        shutil.copy(ROOT / "deploy/release", self.checkout / "deploy/release")
        self.key = self.new_key("key")
        public = self.key.with_suffix(".pub").read_text()
        self.write("deploy/allowed_signers", f'# Keys\nmarble-release namespaces="marble-release" {public}')
        self.git("init", "--quiet")
        self.commit()

    def write(self, name, text, mode=0o644):
        path = self.checkout / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        path.chmod(mode)

    def new_key(self, name):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", self.work / name], check=True)
        return self.work / name

    def git(self, *arguments):
        identity = ["-c", "user.name=A Tester", "-c", "user.email=tester@marble.example"]
        return subprocess.run(["git", *identity, *arguments], cwd=self.checkout, capture_output=True, text=True,
                              check=True).stdout

    def commit(self):
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", "All of it")

    def release(self, *arguments, **environment):
        return self.run_release(*arguments, self.work / "packages", **environment)

    def run_release(self, *arguments, **environment):
        path = f"{self.checkout / 'programs'}{os.pathsep}{os.environ['PATH']}"
        names = {"GIT_COMMITTER_NAME": "A Tester", "GIT_COMMITTER_EMAIL": "tester@marble.example"}
        return subprocess.run([self.checkout / "deploy/release", *arguments], text=True, capture_output=True,
                              env={**os.environ, **names, **environment, "PATH": path})

    def refuses(self, why, *arguments, **environment):
        done = self.release(*arguments, **environment)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn(why, done.stderr)

    def verify(self, signers):
        """What the page "Check a release" has users type."""
        with (self.work / "packages/SHA256SUMS").open() as sums:
            return subprocess.run(["ssh-keygen", "-Y", "verify", "-f", signers, "-I", "marble-release", "-n", "marble-release",
                                   "-s", "SHA256SUMS.sig"], cwd=self.work / "packages", stdin=sums, capture_output=True)

    def test_packages_are_built_with_bills_and_checksums_and_nothing_is_tagged(self):
        done = self.release()
        self.assertEqual(done.returncode, 0, done.stderr)
        sums = (self.work / "packages/SHA256SUMS").read_text().split()[1::2]
        packages = ["marble-server.deb", "marble_solver-manylinux.whl", "marble_solver.whl", "marble_solver.tar.gz", "marble-client.tgz"]
        self.assertEqual(sums[:len(packages)], packages)
        self.assertEqual(set(sums[len(packages):]), {f"{name}.cdx.json" for name in packages})
        self.assertFalse((self.work / "packages/SHA256SUMS.sig").exists())
        self.assertEqual(self.git("tag"), "")

    def test_the_checksums_are_signed_and_a_change_of_them_is_noticed(self):
        done = self.release("--sign", self.key)
        self.assertEqual(done.returncode, 0, done.stderr)
        signers = self.checkout / "deploy/allowed_signers"
        self.assertEqual(self.verify(signers).returncode, 0)
        subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=self.work / "packages", check=True)
        sums = self.work / "packages/SHA256SUMS"
        sums.write_text(sums.read_text().replace("a", "b", 1))
        self.assertNotEqual(self.verify(signers).returncode, 0)

    def test_a_key_that_is_not_among_the_signers_is_refused(self):
        self.refuses("allowed_signers does not have the key", "--sign", self.new_key("another"))
        shutil.rmtree(self.work / "packages")
        self.refuses("no such key", "--sign", self.work / "none")

    def test_a_tag_wants_a_signature(self):
        self.refuses("--tag wants --sign KEY", "--tag")
        self.assertEqual(self.git("tag"), "")

    def test_the_tag_is_made_when_asked_and_carries_this_version_s_changes(self):
        done = self.release("--sign", self.key, "--tag")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.git("tag"), "v1.2.3\n")
        message = self.git("tag", "--list", "--format=%(contents)")
        self.assertIn("What is new.", message)
        self.assertNotIn("Old.", message)
        shutil.rmtree(self.work / "packages")
        self.refuses("the tag v1.2.3 exists")

    def test_changes_that_are_not_committed_are_refused(self):
        self.write("README.md", "new")
        self.refuses("not committed", "--sign", self.key, "--tag")

    def test_a_version_without_a_dated_entry_is_refused(self):
        self.write("CHANGELOG.md", "# Changes\n\n## 1.2.3, unreleased\n")
        self.commit()
        self.refuses("no dated entry of 1.2.3")

    def test_what_is_no_version_is_refused(self):
        self.write("deploy/VERSION", "1.2\n")
        self.commit()
        self.refuses("not major.minor.patch")

    def test_a_contract_that_was_not_released_is_refused(self):
        self.write("build/release/marble.binpb", "another contract")
        self.commit()
        self.refuses("not the contract that was built", "--sign", self.key, "--tag")
        self.assertEqual(self.git("tag"), "")

    def test_faults_of_tidy_are_refused(self):
        self.refuses("tests/tidy found faults", TIDY_FAULTS="1")

    def test_a_dry_run_without_builds_reports_what_a_release_lacks_and_writes_nothing(self):
        self.write("CHANGELOG.md", "# Changes\n\n## 1.2.3, unreleased\n\n## 1.2.2, 2026-01-01\n")
        self.commit()
        self.git("tag", "v1.2.3")
        done = self.run_release("--dry-run", "--skip-builds")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertEqual(done.stdout.splitlines(), [
            "A release would be refused: the tag v1.2.3 exists",
            "A release would be refused: CHANGELOG.md has no dated entry of 1.2.3",
            "Dry run: the checks of 1.2.3 passed. Nothing was built, signed or tagged."])
        self.assertEqual(self.git("status", "--porcelain"), "")

    def test_a_dry_run_refuses_uncommitted_changes_another_version_and_faults_of_tidy(self):
        def refused(why, **environment):
            done = self.run_release("--dry-run", "--skip-builds", **environment)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(why, done.stderr)
        refused("tests/tidy found faults", TIDY_FAULTS="1")
        self.write("deploy/VERSION", "1.3.0\n")
        refused("not committed")
        self.commit()
        refused("deploy/VERSION is 1.3.0, but the newest entry of CHANGELOG.md is of '1.2.3'")

    def test_a_dry_run_builds_the_packages_but_neither_signs_nor_tags(self):
        self.write("build/release/marble.binpb", "another contract")
        self.commit()
        done = self.release("--dry-run")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("A release would be refused: proto/released is not the contract that was built", done.stdout)
        self.assertTrue((self.work / "packages/SHA256SUMS").exists())
        self.refuses("--dry-run neither signs nor tags", "--dry-run", "--sign", self.key, "--tag")
        self.assertEqual(self.git("tag"), "")

    def test_only_a_dry_run_may_skip_the_builds(self):
        self.assertEqual(self.run_release("--skip-builds").returncode, 2)
        self.assertEqual(self.run_release("--dry-run").returncode, 2)


if __name__ == "__main__":
    unittest.main()
