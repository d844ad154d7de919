"""The specification as pages: its parts and figures stay in ``spec/``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

SPECIFICATION = Path(__file__).resolve().parents[2] / "spec"


def on_files(files: Files, config: Any, **_: Any) -> Files:
    """Put the specification's figures beside its pages."""
    for figure in sorted((SPECIFICATION / "figures").glob("*.svg")):
        name = f"specification/figures/{figure.name}"
        files.append(File.generated(config, name, abs_src_path=str(figure)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The text of a part of the specification, where a page is to have it.

    It is indented as CommonMark wants it: what belongs to "1. " begins three columns in. Python-Markdown wants four,
    and an empty line before the next number where indented text ends.
    """
    part = re.fullmatch(r"specification/(\w+\.md)", page.file.src_uri)
    if not part:
        return markdown
    blocks = (SPECIFICATION / part[1]).read_text(encoding="utf-8").split("\n\n")
    return "\n\n".join(block if re.match(r" {4}\S", block) else _indented(block) for block in blocks)


def _indented(block: str) -> str:
    block = re.sub(r"(?m)^((?:  )*) (?=\S)", r"\1  ", block)
    return re.sub(r"(?m)^( .*\n)(?=\d+\. )", r"\1\n", block) if block.startswith(" ") else block
