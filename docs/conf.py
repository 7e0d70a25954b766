"""The documentation site, for Sphinx: deploy/docs builds it from the folder that docs/site/stage.py lays out."""

import os
import pathlib
import re
import sys

from docutils import nodes
from sphinx import addnodes

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs/site"))
REPOSITORY = os.environ.get("MARBLE_REPOSITORY", "").rstrip("/")  # where sources and "Edit this page" link to
BRANCH = os.environ.get("MARBLE_BRANCH", "main")

project = "Marble"
author = "Marble Server maintainers"
release = (ROOT / "deploy/VERSION").read_text(encoding="utf-8").strip()
root_doc = "docs/index"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design", "breathe", "links"]
exclude_patterns = [".github/ISSUE_TEMPLATE", "client/cpp/docs"]
templates_path = ["_templates"]

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4

breathe_projects = {"marble": os.environ["MARBLE_DOXYGEN"]}
breathe_default_project = "marble"
suppress_warnings = ["duplicate_declaration.cpp"]  # of the namespace, which every header opens

smartquotes = False  # "--flag" is what it is

html_theme = "furo"
html_title = f"Marble {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_copy_source = False
html_show_sphinx = False
html_additional_pages = {"index": "redirect.html"}
html_context = {"versions": os.environ.get("MARBLE_VERSIONS", "").split()}  # in folders beside this site's own
html_sidebars = {"**": [f"sidebar/{part}.html" for part in ("brand", "search", "scroll-start", "navigation")]
                 + ["versions.html", "sidebar/scroll-end.html"]}
html_theme_options = {"top_of_page_buttons": ["edit"] if REPOSITORY else []}
if REPOSITORY:
    html_theme_options |= {"source_repository": REPOSITORY, "source_branch": BRANCH, "source_directory": ""}

toc_object_entries = False  # in the navigation of each page they would take most of a build's time
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_mock_imports = ["casadi", "coal", "cvxpy", "mujoco", "pinocchio", "pydrake", "pyomo"]
autodoc_typehints_format = "short"
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "MatrixLike": "MatrixLike"}  # what they stand for fills lines
python_use_unqualified_type_names = True
add_module_names = False


def plain(app, what, name, thing, options, lines):
    """The package's docstrings are words with `code` in them, no markup: |x| is a norm, tls_ a prefix."""
    for at in reversed([at for at, line in enumerate(lines) if at and re.match(r"[a-z_]\w*(, \w+)*(, …)?: ", line)]):
        lines.insert(at, "")  # a paragraph for each argument
    for at, line in enumerate(lines):
        lines[at] = "`".join(re.sub(r"([|*\\]|_(?!\w))", r"\\\1", part) if k % 2 == 0 else f"`{part}`"
                             for k, part in enumerate(line.split("`")))


def short(app, what, name, thing, options, signature, returns):
    """Names of types without what they stand for; a default that is made is an ellipsis, as the parser knows no <factory>."""
    def without_aliases(text):
        array = r"~?numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?numpy\.\w+\]\]"
        return re.sub(array, "ndarray", text).replace("<factory>", "...")
    return signature and without_aliases(signature), returns and without_aliases(returns)


def stack(app, doctree):
    """Has the table of terms stacked in narrow windows: its cells are too long for columns there."""
    if app.env.docname == "docs/terms":
        for part in doctree.findall(nodes.table):
            part["classes"].append("stacked")


def outline(app, doctree):
    """Leaves classes and enumerations of C++ in a page's outline: all members would be in the navigation of each page."""
    for part in doctree.findall(addnodes.desc):
        if part.get("domain") == "cpp" and part["objtype"] not in ("class", "struct", "enum"):
            for signature in part.findall(addnodes.desc_signature):
                if signature.parent is part:
                    signature["_toc_name"] = ""


def setup(app):
    app.connect("autodoc-process-docstring", plain)
    app.connect("autodoc-process-signature", short)
    app.connect("doctree-read", outline, priority=100)
    app.connect("doctree-read", stack)
