"""The guide as a web site: sphinx-build -W -c docs/guide docs/guide/src target/guide.

The chapters are plain Markdown, to be read as they are too; their order stands in src/SUMMARY.md. A link that leads
nowhere is an error, also one to a heading.
"""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

SOURCE = Path(__file__).resolve().parent / "src"

project = "TriCal: the guide"
language = "en"
extensions = ["myst_parser"]
root_doc = "README"
exclude_patterns = ["SUMMARY.md"]
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
html_theme = "alabaster"
html_title = project
html_copy_source = False
html_show_copyright = False
html_static_path = ["style"]
html_css_files = ["guide.css"]
html_theme_options = {"page_width": "1080px", "sidebar_width": "260px", "fixed_sidebar": True}


def _prepare(app: Sphinx, name: str, text: list[str]) -> None:
    """Give the first page the chapters of SUMMARY.md in their order, and take pages outside of the guide as files."""
    text[0] = re.sub(r"\]\((\.\./[^)#]+\.md)\)", r"](<path:\1>)", text[0])
    if name == root_doc:
        chapters = re.findall(r"^- \[[^]]*\]\(([^)]+)\.md\)", (SOURCE / "SUMMARY.md").read_text("utf-8"), re.MULTILINE)
        text[0] += "\n```{toctree}\n:hidden:\n" + "\n".join(chapters) + "\n```\n"


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", _prepare)
