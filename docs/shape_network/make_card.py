"""Writes docs/shape_network/README.md, the card of the shape network that ships.

python docs/shape_network/make_card.py

It reads the figures that `objectmorpher train shape` wrote beside the weights, as "flat" what
`objectmorpher train flat` found, and the figures of the training run that never saw some families;
the pictures are made anew.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from objectmorpher_core.lift.crop import Crop
from objectmorpher_core.lift.relief.shape_look import SeenShape, ShapeModel
from objectmorpher_core.lift.shapes.recognition import FLAT
from objectmorpher_core.models import registry
from objectmorpher_research.training.shapes.sample import Sample, make_sample

FOLDER = Path(__file__).resolve().parent
FIGURES = FOLDER / "figures.json"  # of the weights that ship
HELD_OUT = FOLDER / "held_out.json"  # of a run without some families
UNSEEN = range(50_000_000, 50_000_016)  # seeds
WAYS = ("network", "relief", "inflation", "flat")
CURVES = {"front": "#c2410c", "depth": "#1d4ed8", "normal": "#15803d"}  # colours by loss
WIDTH, HEIGHT, MARGIN = 640, 240, 36  # px of the curve
TILE = 112  # px

TEXT = """# The shape network

Made by `python docs/shape_network/make_card.py` from the figures of the training run.

A silhouette cannot tell a box from a ball. This network looks at what is inside it: from the crop
of a photo about an object, its mask, and DINOv2's patch tokens of the crop it states, for each of
224 x 224 pixels, how near the front is, how far away the ray leaves the part that is seen and the
whole object, the normal, whether the surface ends there before a farther part, and how far off all
that is expected to be; and of the whole object, whether it is flat. The lifter joins it with the
silhouette's own body, each as far as it is sure (`--trust`, or Trust in the Shape panel; at 0 the
silhouette alone gives the shape, as it does where DINOv2's weights are not there).

- **What it is**: a U-Net of {parameters:.1f} million parameters,
  `objectmorpher_core/models/shape.onnx`, {size:.1f} MB (weights in bytes, with a step for
  each channel: its front is 0.7 % of its spread off), SHA-256 `{sha256}`.
- **Licence**: Apache-2.0 as the program. It was trained from nothing on pictures that the program
  draws itself; nobody's weights are in it. At work it reads DINOv2 ViT-S/14's tokens (Apache-2.0),
  and looks at each object twice, once mirrored: the mean of both is used.
- **Training**: `objectmorpher train shape --folder F --samples {samples} --passes {passes:g}`:
  {steps} steps of {batch} samples; half an hour for the samples and an hour and a quarter for the
  training on two cores, without a GPU (three and a half hours on cores without AMX; a GPU is
  used where PyTorch finds one). Called again it goes on where it was stopped; `--start` goes
  on from weights that ship. The same plan draws the same samples.

## What it has seen

{samples} made-up objects of twelve families: creatures, figures, busts, lathe work, boxes,
furniture, rings and tubes, plants, vehicles, sheets and cloth, superquadrics, extrusions. Its
surfaces have not seen the thirteenth, prints: flat things with a picture on them. They are signed
distances, drawn by sphere tracing
(`research/objectmorpher_research/training/shapes`): bevels, holes,
asymmetry, twists and bends; plain, printed, noisy, striped and photographic materials, matt to
mirroring; one to three lamps with shadows; fields of view from 20 to 75 degrees, all pitches, often
cut by the frame, over photographs of scikit-image and scikit-learn. Half of the masks are a little
wrong, as a click's are. No mesh and no real object with known depth was trained on.

Photos that were never trained on; true front and the network's, true normals and the network's,
edges:

![Made-up photos and what the network sees](samples.jpg)

## How well it does

On samples that were never trained on. *front*: mean distance of the front from the true one, after
the best scale and shift, over the object's mean thickness; *thickness*: likewise, as it is. The
network is joined with the silhouette as the lifter does it (how much it is believed, two numbers,
was chosen on these samples); *relief* is the lifter without it,
*inflation* that without looking how things stand, *flat* a board as thick as that is on average.

{means}

![Loss over the steps: front, depth (in quarters of an object's size) and normals](curve.svg)

By family, the error of the front:

{families}

{held_out}

{flat}

How it does on meshes from elsewhere and on photographs stands in [lifting](../lifting/README.md).

## Limits

- It sees 224 pixels across: fingers and spokes of a large object are guessed from their outline.
- Its world has twelve families. What is like none of them, or has a form of several, gets less
  sureness, and is then nearer to the silhouette's.
- Its photographs are few: backgrounds repeat, and materials are simpler than real ones. Glass and
  mirrors are hardly among them.
- The back is a guess by kind: no photo shows what is behind.
"""


def main() -> None:
    told = json.loads(FIGURES.read_text(encoding="utf-8"))
    _draw_samples(FOLDER / "samples.jpg")
    (FOLDER / "curve.svg").write_text(_curve(told["curve"], told["steps"]), encoding="utf-8")
    plan, weights = told["plan"], registry.shape_network()
    assert told["sha256"] == hashlib.sha256(weights).hexdigest(), "the figures are of other weights"
    text = TEXT.format(
        parameters=told["parameters"] / 1e6, size=len(weights) / 1e6, sha256=told["sha256"],
        samples=plan["samples"], passes=plan["passes"], batch=plan["size"], steps=told["steps"],
        means=_means(told), families=_families(told["families"]), held_out=_held_out(),
        flat=_flat(told["flat"]),
    )  # fmt: skip
    (FOLDER / "README.md").write_text(text, encoding="utf-8")


def _flat(told: dict[str, dict[str, int]]) -> str:
    rows = "\n".join(
        f"| {name} | {row['things']} | {row['before']} | {row['after']} |"
        for name, row in told.items()
    )
    return f"""## What is flat

Of a print the surfaces see what is printed, and puff that. Whether a thing is flat is said by two
small layers over the mean and the deviation of its tokens
(`research/objectmorpher_research/training/flatness.py`). They are fitted last, in half a minute:
here on 2,528 prints and 4,556 solids among 8,192 other samples, each as it is and mirrored. That
took a printed mug or ball for flat one time in six. `objectmorpher train flat` trains them
further, the surfaces left as they are: here on 1,290 photos of prints, 570 of round things with the
same pictures on them (plush, balls, cushions, mugs, clocks, bowls), and 1,106 of other solids, most
of them three photos of one thing in other colours. What ships is half way between both.

Of things made afterwards, on which nothing was chosen or trained, so many are taken for flat:

| | things | fitted | trained further |
| --- | ---: | ---: | ---: |
{rows}

By the thickness and the normals of the surfaces it was 75 of 200 prints, and 10 of 420 other
things. A thing counts as flat from log odds of {FLAT:g}. How it is trained further was chosen on
240 of the prints, 120 of the round things with pictures and 250 of the solids, while it was not yet
trained on these, and on 79 objects: the photos and solids of [lifting](../lifting/README.md), and
43 other photographs. None of the 79 is recognised as another kind than before. What is missed is
mostly seen edge-on, cut by the frame, or bent.

Of four times as many made later, 336 of 384 prints are taken for flat, and 7 of 256 round things
with pictures and 2 of 314 other solids. Trained further on three times as many things, 3,456 photos
of prints among 8,500, it takes 315, 3 and 2: more careful, and for as few mistakes no better."""


def _means(told: dict[str, Any]) -> str:
    lines = [
        "| | front, mean | median | thickness, mean | median |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for way in WAYS:
        cells = [told[m][way][k] for k in ("front", "thickness") for m in ("means", "medians")]
        lines.append(f"| {way} | " + " | ".join(f"{cell:.3f}" for cell in cells) + " |")
    return "\n".join(lines)


def _families(families: dict[str, Any]) -> str:
    lines = ["| | " + " | ".join(WAYS) + " |", "| --- " + "| ---: " * len(WAYS) + "|"]
    for name, row in sorted(families.items()):
        lines.append(f"| {name} | " + " | ".join(f"{row[way]['front']:.3f}" for way in WAYS) + " |")
    return "\n".join(lines)


def _held_out() -> str:
    if not HELD_OUT.exists():
        return ""
    told = json.loads(HELD_OUT.read_text(encoding="utf-8"))
    names = told["plan"]["held_out"]
    rows = {name: told["families"][name] for name in names}
    return (
        f"Another run ({told['steps']} steps) never saw {' and '.join(names)}. On these:\n\n"
        + _families(rows)
    )


def _curve(curve: list[dict[str, float]], steps: int) -> str:
    """An SVG of some losses, each over its own first value."""
    body = []
    for row, (name, colour) in enumerate(CURVES.items()):
        values = np.array([point[name] for point in curve])
        x = np.linspace(MARGIN, WIDTH - MARGIN, len(values))
        y = HEIGHT - MARGIN - (HEIGHT - 2 * MARGIN) * np.clip(values / values[0], 0, 1)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        body.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        body.append(
            f'<text x="{WIDTH - MARGIN - 150}" y="{MARGIN + 16 * row}" fill="{colour}">'
            f"{name}: {values[0]:.3f} to {values[-1]:.3f}</text>"
        )
    corner = f"M{MARGIN},{MARGIN} V{HEIGHT - MARGIN} H{WIDTH - MARGIN}"
    axis = f'<path d="{corner}" fill="none" stroke="#555"/>'
    label = f'<text x="{WIDTH - MARGIN - 60}" y="{HEIGHT - 12}" fill="#555">{steps} steps</text>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" '
        f'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="white"/>'
        f"{axis}{label}{''.join(body)}</svg>\n"
    )


def _draw_samples(path: Path) -> None:
    """Photo; front, true and found; normals, true and found; edges found. Two samples in a row."""
    net = ShapeModel(registry.shape_network())
    rows = []
    for seed in UNSEEN:
        sample = make_sample(seed)
        crop = Crop(0, 0, len(sample.mask), sample.tangents)
        rows.append(_row(sample, net.look(sample.rgb, sample.mask, crop)))
    half = len(rows) // 2
    sheet = np.concatenate([np.concatenate(part, 0) for part in (rows[:half], rows[half:])], 1)
    cv2.imwrite(str(path), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


def _row(sample: Sample, seen: SeenShape) -> np.ndarray:
    mask = sample.mask[..., None]
    low, high = np.quantile(sample.front[sample.mask], [0.01, 0.99])
    fronts = [
        np.repeat(np.clip((f - low) / max(high - low, 1e-3), 0, 1)[..., None], 3, 2)
        for f in (sample.front, seen.front)
    ]
    normals = [0.5 + 0.5 * n * [1, -1, -1] for n in (sample.normal, seen.normal)]
    edges = np.where(seen.edge[..., None] > 0.5, [1.0, 0.2, 0.2], 0.4 * sample.rgb / 255)
    tiles = [sample.rgb / 255, *(tile * mask for tile in (*fronts, *normals)), edges * mask]
    sized = [
        cv2.resize(t.astype(np.float32), (TILE, TILE), interpolation=cv2.INTER_AREA) for t in tiles
    ]
    return np.clip(np.concatenate(sized, 1) * 255 + 0.5, 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
