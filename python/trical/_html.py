"""Small tables for notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


def table(head: Sequence[str], rows: Sequence[Sequence[object]], caption: str) -> str:
    """Return a table with a caption; numbers stand on the right."""

    def cell(value: object) -> str:
        if isinstance(value, float):
            return f'<td style="text-align:right">{value:.4g}</td>'
        if isinstance(value, int):
            return f'<td style="text-align:right">{value}</td>'
        return f'<td style="text-align:left">{escape(str(value))}</td>'

    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join(f"<tr>{''.join(map(cell, r))}</tr>" for r in rows)
    return f"<table><caption>{escape(caption)}</caption><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def note(text: str) -> str:
    """Return a paragraph, or nothing."""
    return f"<p>{escape(text)}</p>" if text else ""
