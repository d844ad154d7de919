"""The pictures of the papers anew, from a folder of real arrays.

``python tools/figures FOLDER -o OUT [NAME ..]`` draws all figures, or those named, to ``OUT/*.png``, and prints their
numbers. All of them take about half an hour. A figure that fails does not keep the others from being drawn.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from pathlib import Path

import matplotlib

if not __package__:
    # run as a folder: the modules next to this one are found by the name of the package
    sys.path[0] = str(Path(__file__).resolve().parent.parent)
matplotlib.use("Agg")

from figures.cubic import cubic
from figures.hyperbola import hyperbola
from figures.mapped import irregular
from figures.planes import cortex, criteria, levels, plate, terrain
from figures.predictions import predictions
from figures.rates import rates, surface_rates
from figures.scattered import scattered
from figures.surfaces import surfaces
from figures.thinned import thinned, thinned_pictures
from figures.thresholds import thresholds
from figures.walk import walk

FIGURES = {
    "criteria": criteria, "levels": levels, "walk": walk, "hyperbola": hyperbola, "cubic": cubic,
    "predictions": predictions, "plate": plate, "cortex": cortex, "terrain": terrain, "thresholds": thresholds,
    "rates": rates, "surface-rates": surface_rates, "surfaces": surfaces, "irregular": irregular, "thinned": thinned,
    "thinned-pictures": thinned_pictures, "scattered": scattered,
}


def drawn(name: str, folder: Path, output: Path) -> bool:
    """Draw a figure, or report why that failed; the others do not depend on it."""
    began = time.perf_counter()
    try:
        FIGURES[name](folder, output)
    except Exception:
        traceback.print_exc()
        return False
    print(f"{name}: {time.perf_counter() - began:.0f} s", flush=True)
    return True


def main() -> None:
    """Draw what is asked for; the exit code is 1 if a figure failed."""
    text = "\n".join(f"  {name:16} {(draw.__doc__ or '').splitlines()[0]}" for name, draw in FIGURES.items())
    parser = argparse.ArgumentParser(
        description=f"{__doc__}\nFigures:\n{text}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help="figures to draw; all if none is named")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder of the pictures")
    options = parser.parse_intermixed_args()
    if unknown := set(options.names) - set(FIGURES):
        parser.error(f"there is no figure {', '.join(sorted(unknown))}; there are {', '.join(FIGURES)}")
    options.output.mkdir(parents=True, exist_ok=True)
    failed = [name for name in options.names or FIGURES if not drawn(name, options.folder, options.output)]
    if failed:
        sys.exit(f"not drawn: {', '.join(failed)}")


if __name__ == "__main__":
    main()
