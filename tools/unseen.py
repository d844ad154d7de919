"""Signs of pictures beside JBIG1, class by class, also of classes that the tables have not been trained on.

    python tools/unseen.py FOLDER                           with the tables of the codec
    python tools/unseen.py FOLDER --tables OTHER.bin        with those of ``tools/train.py FOLDER -o OTHER.bin``

FOLDER is that of ``train.py``: of its arrays those in ``train.ITEMS`` count as trained on, the others as kept aside.
Beside them stand pictures that are made or found here: text in fonts, plots, photographs and textures that come with
scikit-image. Needs the extra ``dev`` and the library of jbigkit.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import font_manager
from matplotlib import pyplot as plt
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from skimage import data
from skimage.color import rgb2gray

import isocodec
from acceptance import items
from bench import jbig
from isospec.tables import unpacked
from train import ITEMS, use

WORDS = (Path(__file__).resolve().parent.parent / "LICENSE").read_text(encoding="utf-8").splitlines()
PHOTOGRAPHS = ("astronaut", "cat", "coffee", "rocket", "cell", "clock", "hubble_deep_field", "immunohistochemistry")
TEXTURES = ("brick", "grass", "gravel")
SHARES = (25, 50, 80)
"""Hundredths of a picture's samples that lie below its isovalues."""
Named = tuple[str, NDArray[np.bool_]]


def documents() -> Iterator[Named]:
    """Pages of text in several fonts and sizes, some of them turned a little, blurred and noisy."""
    rng = np.random.default_rng(1)
    for i, family in enumerate(("DejaVu Sans", "DejaVu Serif", "DejaVu Sans Mono", "STIXGeneral", "cmr10", "cmss10")):
        for size in (11, 17, 26):
            font = ImageFont.truetype(font_manager.findfont(family), size)
            page = Image.new("L", (480, 400), 230)
            draw = ImageDraw.Draw(page)
            for line in range(400 // (size * 3 // 2)):
                draw.text((12, 8 + line * size * 3 // 2), WORDS[(9 * i + line) % len(WORDS)], 40, font)
            turned = page.rotate((0.0, 1.7, -0.6)[i % 3], Image.Resampling.BICUBIC, fillcolor=230)
            noise = rng.integers(-30, 31, (400, 480)) * (i % 2)
            yield f"{family} {size}", np.asarray(turned).astype(int) + noise > 128


def plots() -> Iterator[Named]:
    """Line plots, scattered marks, hatched bars and contours, as a program draws them."""
    rng = np.random.default_rng(2)
    x = np.linspace(0, 9, 200)
    waves = np.sin(x)[:, None] * np.cos(1.3 * x) + 0.3 * np.sin(2.1 * x)[:, None]
    for size in (4.0, 6.0):
        figure, axes = plt.subplots(2, 2, figsize=(size, size), dpi=90, layout="constrained")
        for i in range(4):
            axes[0, 0].plot(x, np.sin(x + i) * np.exp(-0.1 * i * x), linewidth=0.7 + 0.4 * i, color="black")
        axes[0, 1].plot(*rng.normal(size=(2, 120)), "o", markersize=3, fillstyle="none", color="black")
        for i, hatch in enumerate(("//", "xx", "..", "+")):
            axes[1, 0].bar(i, 2 + i, hatch=hatch, color="white", edgecolor="black")
        axes[1, 1].contour(waves, 9, colors="black", linewidths=0.8)
        held = io.BytesIO()
        figure.savefig(held, format="png")
        plt.close(figure)
        yield f"plots {size:g}", np.asarray(Image.open(held).convert("L")) > 128


def pictures(names: tuple[str, ...]) -> Iterator[Named]:
    """Pictures of scikit-image at several isovalues."""
    for name in names:
        picture = getattr(data, name)()
        grey = picture if picture.ndim == 2 else np.rint(rgb2gray(picture[..., :3]) * 255)
        for share in SHARES:
            yield f"{name} {share}", grey > np.percentile(grey, share)


def of_folder(folder: Path, trained: bool) -> Iterator[Named]:
    for item in items(folder, 2):
        half = item.half()
        if (item.name in ITEMS[2]) == trained:
            yield f"{item.name}@{half.isovalue:g}", half.values > half.isovalue


def classes(folder: Path) -> Iterator[tuple[str, list[Named]]]:
    """All classes, by name."""
    yield "text in fonts", list(documents())
    yield "plots", list(plots())
    yield "photographs", list(pictures(PHOTOGRAPHS))
    yield "textures", list(pictures(TEXTURES))
    for trained, told in ((False, "kept aside"), (True, "trained on")):
        found: dict[str, list[Named]] = {}
        for name, mask in of_folder(folder, trained):
            found.setdefault(name.split("/")[0], []).append((name, mask))
        yield from ((f"{kind}, {told}", pages) for kind, pages in sorted(found.items()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--tables", type=Path, help="tables to use")
    options = parser.parse_args()
    mpl.use("Agg")
    if options.tables:
        squash, tables = unpacked(options.tables.read_bytes())
        use(2, squash, tables[2])
    print("| class | pictures | bytes | JBIG1 | mean ratio | worst | above 1 |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind, pages in classes(options.folder):
        ours, theirs, names = [], [], []
        for name, mask in pages:
            if mask.any() and not mask.all():
                names.append(name)
                ours.append(len(isocodec.encode(mask, profile="main")))
                theirs.append(len(jbig.encode(mask)))
        ratio = np.array(ours) / np.array(theirs)
        worst = int(np.argmax(ratio))
        mean = float(np.exp(np.log(ratio).mean()))
        row = (kind, len(ours), f"{sum(ours):,}", f"{sum(theirs):,}", f"{mean:.3f}",
               f"{ratio[worst]:.3f} ({names[worst]})", int((ratio > 1).sum()))
        print("|", " | ".join(map(str, row)), "|")


if __name__ == "__main__":
    main()
