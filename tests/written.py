"""What tests of writers share."""

from __future__ import annotations

from typing import Any

from isocodec.io.writers.output_formats import OutputOptions
from isocodec.io.writers.write import render


def rendered(what: Any, suffix: str, **options: Any) -> bytes:
    """The file of something in a format."""
    return render(what, options=OutputOptions(to=suffix, **options))
