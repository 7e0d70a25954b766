"""Runs a notebook of docs/notebooks, and makes a page of its cells and of what they show. A cell that draws describes its
picture in its metadata, as `alt`.

Usage: notebooks.py NOTEBOOK FOLDER BUILD_DIR    writes NAME.md and NAME-K.svg to the folder. Exits with 1 where a cell fails or
the notebook has outputs, and with 77 and a page without outputs where a package that its metadata `requires` is missing
"""

import importlib.util
import os
import pathlib
import sys
import tempfile

import pages

CELL_S = 300  # for each cell, on a busy machine too
SETUP = """%matplotlib inline
%config InlineBackend.figure_formats = ['svg']
"""


def outputs(cell, name, folder, count):
    """What a cell shows: text as it is printed, pictures as files."""
    printed, pictures = "", []
    for output in cell.outputs:
        if output.output_type == "stream":
            printed += output.text
        elif "image/svg+xml" in output.data:
            picture = f"{name}-{count + len(pictures)}.svg"
            (folder / picture).write_text(output.data["image/svg+xml"], encoding="utf-8")
            pictures.append(picture)
        else:
            printed += output.data["text/plain"] + "\n"
    text = f"```text\n{printed.rstrip()}\n```\n\n" if printed else ""
    if pictures and not cell.metadata.get("alt"):
        sys.exit(f"{name}: a cell draws without the metadata `alt`:\n{cell.source}")
    return text + "".join(f"![{cell.metadata.alt}]({picture})\n\n" for picture in pictures), count + len(pictures)


def page(cells, name, folder, how="was run when this page was made"):
    text, count = "", 1
    for cell in cells:
        if cell.cell_type == "markdown":
            text += cell.source + "\n\n"
        else:
            shown, count = outputs(cell, name, folder, count)
            text += f"```python\n{cell.source}\n```\n\n{shown}"
    title, rest = text.split("\n\n", 1)
    return f"{title}\n\n{{download}}`This notebook <{name}.ipynb>` {how}.\n\n{rest}"


def main():
    path, folder, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    import nbclient
    import nbformat
    from traitlets.config import Config

    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    if any(cell.cell_type == "code" and (cell.outputs or cell.execution_count) for cell in notebook.cells):
        sys.exit(f"{path}: has outputs; remove them before a commit")
    absent = [name for name in notebook.metadata.get("requires", []) if importlib.util.find_spec(name) is None]
    target = folder / f"{path.stem}.md"
    if absent:
        why = f"was not run: {', '.join(absent)} is not installed"
        print(f"{path.name} {why}")
        target.write_text(page(notebook.cells, path.stem, folder, why), encoding="utf-8")
        sys.exit(77)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(SETUP))
    with tempfile.TemporaryDirectory() as own:
        os.environ |= pages.environment(build) | {"IPYTHONDIR": own, "JUPYTER_RUNTIME_DIR": own, "JUPYTER_CONFIG_DIR": own}
        del os.environ["MPLBACKEND"]  # the kernel's own
        client = nbclient.NotebookClient(notebook, timeout=CELL_S, kernel_name="python3",
                                         resources={"metadata": {"path": folder}},
                                         config=Config({"KernelManager": {"transport": "ipc", "ip": f"{own}/kernel"}}))
        try:
            client.execute()
        except nbclient.exceptions.CellExecutionError as error:
            sys.exit(f"{path}: {error}")
    target.write_text(page(notebook.cells[1:], path.stem, folder), encoding="utf-8")  # without the set-up


main()
