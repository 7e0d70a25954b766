"""Tables of facts for notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable

_LEFT = "style='text-align:left'"


def table(title: str, rows: Iterable[tuple[str, str]], colour: str = "") -> str:
    """A table with a title, before which there may be a dot of a colour; each row a name and a text. All is escaped."""
    dot = f"<span style='color:{colour}'>●</span> " if colour else ""
    body = "".join(f"<tr><th {_LEFT}>{html.escape(name)}</th><td {_LEFT}>{html.escape(text)}</td></tr>"
                   for name, text in rows)
    return f"<table><caption {_LEFT}>{dot}<b>{html.escape(title)}</b></caption>{body}</table>"
