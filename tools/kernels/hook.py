"""What hatchling calls while it builds a wheel: the wheel gets the library of its platform, and the viewer.

Needs nothing where the library has been built before; else `REQUIREMENTS`, which hatchling has installed by then.
"""

from __future__ import annotations

import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parent))

import build
import shown
from targets import TARGETS, Target, native

CHOICE = "ISOCODEC_WHEEL"
"""Name of a platform, in the environment: for a wheel that is not of this one."""

VIEWER = "index.html", "viewer.css", "viewer.js", "main.js", "domain.js", "tiles.js"
"""Files of the page that `isocodec serve` shows, where it has been built; it has the tables anyway."""


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]
    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """What has to be installed for this build."""
        target = _target()
        return [] if target is None or build.is_kept(target) else build.requirements()

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before the wheel is put together."""
        self._open = ExitStack()
        viewer = Path(self.root, "build", "viewer")
        for name in VIEWER if version != "editable" and (viewer / VIEWER[0]).is_file() else ():
            build_data["force_include"][str(viewer / name)] = f"isocodec/cli/viewer/{name}"
        target = _target()
        if target is None:
            shown.say("no library for this platform: this wheel's kernels run as plain Python, or compiled by numba")
            return
        place = self._open.enter_context(build.library(target, os.cpu_count() or 1, shown.progress))
        if version == "editable":
            build.put_into_checkout(place)
            return
        for path in place.iterdir():
            build_data["force_include"][str(path)] = f"isocodec/kernel/built/{path.name}"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{target.tag}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """After it is."""
        self._open.close()


def _target() -> Target | None:
    name = os.environ.get(CHOICE)
    return TARGETS[name] if name else native()
