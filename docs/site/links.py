"""A Sphinx extension: links of pages to files and folders that are no pages lead to the repository."""

import pathlib

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.transforms.post_transforms import SphinxPostTransform

ROOT = pathlib.Path(__file__).resolve().parents[2]


class SourceLinks(SphinxPostTransform):
    """Without the repository's address, such a link is plain text. One to a missing file is left to MyST's error."""

    default_priority = 8  # before MyST looks among the pages

    def run(self, **_):
        theme = self.config.html_theme_options
        for node in list(self.document.findall(pending_xref)):
            if node["reftype"] != "myst" or node.get("refdomain"):
                continue
            path = (ROOT / self.env.docname).parent.joinpath(node["reftarget"]).resolve()
            if not path.exists() or not path.is_relative_to(ROOT):
                continue
            text = node[0].deepcopy()
            if "source_repository" in theme:
                place = f"{'tree' if path.is_dir() else 'blob'}/{theme['source_branch']}/{path.relative_to(ROOT)}"
                text = nodes.reference("", "", text, refuri=f"{theme['source_repository']}/{place}")
            node.replace_self(text)


def setup(app):
    app.add_post_transform(SourceLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
