"""deploy/make-sbom: what the bills of materials hold, and that deploy/VULNERABILITIES.md has a row of every package that the
programs of a build link.

Usage: sbom_test.py BUILD_DIR
"""

import hashlib
import importlib.machinery
import importlib.util
import io
import json
import pathlib
import re
import subprocess
import sys
import tarfile
import tempfile
import unittest
import unittest.mock
import zipfile

sys.dont_write_bytecode = True
ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv[1]).resolve()
sys.path.insert(0, str(ROOT / "deploy"))
import debian_packages


def load(name):
    loader = importlib.machinery.SourceFileLoader(name.replace("-", "_"), str(ROOT / "deploy" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


make_sbom = load("make-sbom")


def run(*command):
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)


class Sbom(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        work = tempfile.TemporaryDirectory(prefix="marble sbom ")
        cls.addClassCleanup(work.cleanup)
        cls.work = pathlib.Path(work.name)
        tree = cls.work / "tree"
        for component in ("server", "cli"):
            run("cmake", "--install", BUILD, "--prefix", tree / "usr", "--component", component)
        (tree / "DEBIAN").mkdir()
        (tree / "DEBIAN/control").write_text("Package: marble\nVersion: 1\nArchitecture: amd64\nMaintainer: A Tester "
                                             "<tester@marble.example>\nDescription: a test\n")
        cls.package = cls.work / "marble_1_amd64.deb"
        run("dpkg-deb", "--root-owner-group", "-Znone", "--build", tree, cls.package)
        cls.bill = make_sbom.bill_of(cls.package)
        cls.written = json.loads(cls.bill.write().read_text())

    def components(self, bill=None):
        return {one["name"]: one for one in (bill or self.written)["components"]}

    def test_every_package_that_is_linked_has_a_row_on_the_page(self):
        self.bill.check()
        sources = {one["properties"][0]["value"] for one in self.components().values() if "properties" in one}
        self.assertGreaterEqual(sources, {"grpc", "c-ares", "protobuf", "openssl", "sqlite3", "postgresql-15", "openblas",
                                          "libzip", "libamplsolver", "eigen3", "glibc"})

    def test_a_package_without_a_row_is_refused(self):
        rest = make_sbom.listed_packages() - {"c-ares"}
        with unittest.mock.patch.object(make_sbom, "listed_packages", lambda: rest):
            with self.assertRaisesRegex(SystemExit, "links libc-ares2, but .* no row of c-ares"):
                self.bill.check()

    def test_the_page_has_no_row_of_what_nothing_links(self):
        sources = {one["properties"][0]["value"] for one in self.components().values() if "properties" in one}
        self.assertEqual(make_sbom.listed_packages() - sources, {"pybind11"})  # of wheels

    def test_the_bill_is_cyclonedx_whose_references_hold(self):
        self.assertEqual((self.written["bomFormat"], self.written["specVersion"], self.written["version"]), ("CycloneDX", "1.5", 1))
        self.assertRegex(self.written["serialNumber"], r"^urn:uuid:[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}$")
        self.assertRegex(self.written["metadata"]["timestamp"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$")
        described = self.written["metadata"]["component"]
        digest = hashlib.sha256(self.package.read_bytes()).hexdigest()
        self.assertEqual(described["hashes"], [{"alg": "SHA-256", "content": digest}])
        refs = [one["bom-ref"] for one in self.written["components"]] + [described["bom-ref"]]
        self.assertEqual(len(refs), len(set(refs)))
        for dependency in self.written["dependencies"]:
            self.assertLessEqual({dependency["ref"], *dependency["dependsOn"]}, set(refs))
        for one in self.written["components"]:
            self.assertIn(one["type"], ("library", "file"))
            self.assertTrue(one["type"] == "file" or re.match(r"pkg:[a-z]+/\S+@\S+$", one["purl"]), one)

    def test_programs_and_installed_versions_are_in_it(self):
        components = self.components()
        for program in ("usr/bin/marble", "usr/bin/marble-server", "usr/libexec/marble/marble-all"):
            self.assertEqual(components[program]["type"], "file")
        for package in ("libgrpc++1.51", "libc-ares2", "libpq5", "libeigen3-dev"):
            version = debian_packages.run("dpkg-query", "-W", "-f", "${Version}", package)
            self.assertEqual(components[package]["version"], version)
        edges = {one["ref"]: one["dependsOn"] for one in self.written["dependencies"]}
        self.assertIn(components["libc-ares2"]["bom-ref"], edges[components["libgrpc29"]["bom-ref"]])
        self.assertTrue(components["libgrpc++1.51"]["licenses"])

    def test_the_same_artefact_has_the_same_bill(self):
        self.assertEqual(json.loads(make_sbom.bill_of(self.package).write().read_text()), self.written)

    def test_wheels_and_archives_list_what_they_are_installed_with(self):
        wheel = self.work / "marble_solver-1-py3-none-any.whl"
        with zipfile.ZipFile(wheel, "w") as archive:
            archive.writestr("marble_solver-1.dist-info/METADATA",
                             "Name: marble-solver\nRequires-Dist: grpcio>=1.51\nRequires-Dist: torch; extra == 'torch'\n\ntext")
            archive.writestr("marble_solver-1.dist-info/licenses/INSIDE", "x\n\npybind11.LICENSE: compiled in, version 2.13.6\n")
        names = {one["purl"] for one in json.loads(make_sbom.bill_of(wheel).write().read_text())["components"]}
        self.assertEqual(names, {"pkg:pypi/grpcio", "pkg:pypi/pybind11@2.13.6"})
        npm = self.work / "marble-client-1.tgz"
        with tarfile.open(npm, "w:gz") as archive:
            archive.addfile(tarfile.TarInfo("package/package.json"), io.BytesIO())
        names = {one["name"] for one in json.loads(make_sbom.bill_of(npm).write().read_text())["components"]}
        self.assertIn("@grpc/grpc-js", names)
        self.assertNotIn("typescript", names)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
