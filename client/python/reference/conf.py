# The API's reference, from the package's own words. PYTHONPATH names the package.
import re

import marble

project = "marble-solver"
release = marble.__version__
extensions = ["sphinx.ext.autodoc"]
default_role = "code"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_mock_imports = ["casadi", "coal", "cvxpy", "mujoco", "pinocchio", "pydrake", "pyomo"]  # not in Debian
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "MatrixLike": "MatrixLike"}  # what they stand for fills lines
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
add_module_names = False
html_theme = "classic"
html_copy_source = False


def plain(app, what, name, thing, options, lines):
    """The package's docstrings are words with `code` in them, no markup: |x| is a norm, tls_ a prefix."""
    for at, line in enumerate(lines):
        lines[at] = "`".join(re.sub(r"([|*\\]|_(?!\w))", r"\\\1", part) if k % 2 == 0 else part
                             for k, part in enumerate(line.split("`")))


def setup(app):
    app.connect("autodoc-process-docstring", plain)
