"""The text of the page. Its numbers come from what it is given."""

from __future__ import annotations

import numpy as np
from depths import WAYS as SURFACES
from motorcycle import Result
from turning import GROUPS, WAYS, Row, Score, means

from objectmorpher_research.training import shape_eval

FAR = ("turn 20", "turn 35")  # of which every solid is told
TOLD = ("network", "relief", "card", "affine")  # likewise
Depths = dict[str, dict[str, shape_eval.ShapeError]]

HEAD = """# Lifting, measured

Made by `python docs/lifting/make_lifting.py`; every number comes from that command.

The embedded lifter (`--lift relief`) makes a closed shape from one silhouette, and from what our
[shape network](../shape_network/README.md) sees inside it. How much of the truth is that? Ten
solids whose every view is known are drawn into a photo (512 px, 50 degrees of view, over a blurred
picture, seen from 6 to 18 degrees above, the ring from 50), lifted with the default settings under
their exact mask, and edited: turned by 10, 20 and 35 degrees to both sides, pitched by 20 both
ways, brought nearer by three tenths of their distance, and bent by 40 degrees towards the camera
and away (all control points are led along the same bend). The lighting is painted on. What comes
out is compared with the true view:

- **IoU**: of the two coverages, soft edges counted softly.
- **PSNR**: dB, over the true background, over all pixels that either of the two covers.

*network* is the product as it ships, *relief* the same without the network (`--trust 0`),
*inflation* that without looking how things stand, *depth* the relief with the true inverse depth,
as a perfect depth network would see it: scale and shift are not given. Beside them stand two ways
to do without a shape:

- **card**: the cut-out on a flat board at the solid's true distance, moved so. A homography.
- **affine**: the best that any affine warp of the cut-out can do: it is fitted to the true places
  of the points that the photo shows. It knows the answer; nothing that works from one photo does.

All may be shifted, so that the middles of their boxes agree with the truth's: about which
depth a thing turns is not in the photo.

What is seen is then explained by a few plain shapes, each fitted to outline, depth and normals: a
flat sheet, a box, an ellipsoid, a ring and a surface of revolution, whose profile is read off the
outline, about the axis with which it is simplest. Each is drawn as the camera would see it and
compared; the one that describes the object in the fewest words takes the place of the network's
surface as far as it explains it, rights how the whole leans, and gives the far side that no photo
shows. Where none does, the shape stays free. `--shape`, or Kind in the Shape panel, overrules that.

Before all that, an outline that is mostly one ellipse is taken for a circle in perspective, the rim
of a plate or a bowl, if the network sees at least a third of the lean that such a circle has: the
front then passes through it. A second, nearer circle about the same axis is the lip of a cup: the
cup is a surface of revolution of its own, and the saucer goes on behind it, in the colours that it
has elsewhere at the same distance from the axis.

Seven of the solids are meshes of the package pybullet (zlib licence), which are fetched and not
kept here; the figure, the mug and the box are made by `solids.py`. The thresholds in
`lift/relief/prism.py` and `lift/relief/standing.py` were chosen while looking at these ten, so they
say what the method can do rather than what it will do. The network was trained on none of them. The
motorcycle and the photos below were not used for the silhouette's rules; pictures of theirs are
among the backgrounds and materials that the network has seen.
"""
DEPTH = """## Their surfaces

How far the fronts are from the true ones, over each solid's mean thickness, after the best scale
and shift; seen from eight sides each. *inflation* is the relief without looking how things stand,
*flat* a board as thick as that is on average.
"""
OUTLINES = """## Outlines and newly shown sides

`python docs/lifting/make_lifting.py quick` prints, for each turn of each solid, the *wobble* of the
outline (its total absolute curvature over the true one's, evenly resampled and smoothed by 1 % of
the square root of the area, without the frame), pieces and holes beyond the true ones, and of the
newly shown surface the shares that are drawn out along one direction, or flat, beyond what 2 % of
the object's own surface are. PSNR in dB and wobble, before and after shapes had profiles of their
own, rings were known and what lies behind was left as it is settled, without evening its rim:

|  | before: turn 20 | turn 35 | pitch 20 | after: turn 20 | turn 35 | pitch 20 |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |
| duck | 18.6, 1.16 | 16.6, 0.97 | 18.0, 1.15 | 18.5, 1.07 | 16.6, 0.93 | 18.1, 1.03 |
| bunny | 13.7, 0.89 | 13.0, 0.82 | 14.6, 1.27 | 13.7, 0.85 | 13.0, 0.76 | 14.6, 1.21 |
| teddy | 17.9, 1.03 | 15.2, 0.86 | 17.9, 1.03 | 17.9, 0.99 | 15.3, 0.89 | 17.9, 0.99 |
| ball | 27.9, 1.39 | 25.4, 1.32 | 23.4, 1.71 | 26.7, 1.23 | 23.7, 1.29 | 26.3, 1.20 |
| ring | 11.4, 1.41 | 9.5, 1.33 | 10.9, 1.39 | 17.6, 1.29 | 15.7, 1.12 | 16.6, 1.24 |
| brick | 18.8, 1.84 | 17.0, 2.23 | 15.8, 2.01 | 19.1, 1.73 | 17.7, 2.24 | 16.6, 2.19 |
| robot | 16.9, 1.67 | 16.1, 1.60 | 14.1, 1.21 | 17.0, 1.54 | 16.3, 1.58 | 14.2, 1.15 |
| figure | 18.6, 1.08 | 16.2, 1.02 | 18.5, 1.11 | 18.6, 1.03 | 16.2, 0.94 | 18.5, 1.06 |
| mug | 16.4, 1.30 | 14.8, 1.90 | 17.0, 1.21 | 16.1, 1.41 | 14.4, 2.03 | 15.9, 1.68 |
| box | 23.9, 1.63 | 21.6, 2.01 | 20.7, 1.77 | 24.4, 1.60 | 23.0, 2.04 | 23.0, 1.80 |
| **mean** | 18.4, 1.34 | 16.6, 1.41 | 17.1, 1.39 | 19.0, 1.27 | 17.2, 1.38 | 18.1, 1.35 |

Where the rest is lost: the same ten, and the ten of `HELD_OUT` in `solids.py` before rims were
looked for, with parts of the network's front replaced by the true ones. The *lean* is the plane
nearest to a front, its *shape* what is left of it, PSNR in dB:

|  | ten: turn 20 | turn 35 | pitch 20 | held out: turn 20 | turn 35 | pitch 20 |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |
| without plain shapes | 17.7 | 15.6 | 16.9 | 17.6 | 15.1 | 16.5 |
| as it is | 19.0 | 17.2 | 18.2 | 18.0 | 15.5 | 17.2 |
| the best depth scale | 18.8 | 17.1 | 18.1 | 18.2 | 15.7 | 17.5 |
| the true lean | 19.7 | 17.7 | 19.1 | 19.6 | 16.9 | 18.8 |
| the true shape | 19.8 | 18.0 | 18.8 | 18.9 | 16.0 | 18.5 |
| the true front | 22.5 | 19.5 | 20.8 | 22.6 | 18.9 | 21.4 |

So lean and shape cost about as much, and each alone gives a fifth to a third of what both together
do; the depth scale costs nothing. The other tables of this page, and the row of the network in
them, are older than plain shapes.

Where nothing is recognised the network sees too little lean. On 150 views of meshes of pybullet
that this page does not use (parts of robots, and random ones) and of the solids of `evaluate
truth`, none of them recognised, what is true is 1.8 times what it sees up and down, and 1.7 times
to the sides; the blend with an upright silhouette takes another part of it away. But what it sees
to lean by less than about ten degrees is as often something else: made larger, it is worse. From 9
degrees on, and wholly from 14 on, 1.2 times what is seen is added, a number chosen on those views.
The error of the slopes, root mean square, falls from 0.38 to 0.33 to the sides and from 0.42 to
0.33 up and down. That small leans are left was decided when figure and teddy had lost 0.7 dB by a
plain factor, and bunny, hand and lamp had won. A turn feels small errors most, and those stay: so
little is gained where the true lean would give much. Of the ten, only the bunny changes by it, of
those held out hand and lamp. The rest is of plates, which have one arch beneath their rim now, of
cups, beside whose lip no walls hang, and of hidden sides, which keep to the colours of their own
part. PSNR in dB and wobble before and after, the means of both last:

|  | before: turn 20 | turn 35 | pitch 20 | after: turn 20 | turn 35 | pitch 20 |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |
| bunny | 13.7, 0.85 | 13.0, 0.77 | 14.6, 1.22 | 14.7, 0.84 | 12.7, 0.78 | 15.5, 1.21 |
| plate | 21.8, 1.47 | 20.1, 1.64 | 19.4, 1.57 | 23.2, 1.48 | 22.3, 1.55 | 21.5, 1.43 |
| cup | 27.0, 1.62 | 24.6, 1.73 | 27.1, 2.09 | 27.3, 1.45 | 24.7, 1.70 | 28.0, 1.63 |
| lamp | 17.6, 1.20 | 15.4, 1.15 | 15.1, 1.26 | 18.3, 1.21 | 15.9, 1.14 | 15.2, 1.27 |
| hand | 17.7, 1.25 | 15.0, 1.10 | 17.4, 1.22 | 18.3, 1.24 | 15.6, 1.22 | 19.0, 1.30 |
| domino | 17.5, 1.58 | 14.2, 1.51 | 14.5, 2.23 | 17.3, 1.58 | 14.0, 1.51 | 14.9, 2.23 |
| *ten* | 19.0, 1.32 | 17.3, 1.38 | 18.2, 1.35 | 19.2, 1.31 | 17.3, 1.38 | 18.3, 1.35 |
| *held out* | 19.3, 1.36 | 16.8, 1.35 | 18.6, 1.66 | 19.5, 1.35 | 17.1, 1.35 | 19.1, 1.61 |

Plate and cup were looked at while that was made. Three of the twenty lose more than 0.1 dB: the
bunny when turned by 35 degrees, and ring and domino, 0.1 to 0.3 dB, whose sides have less of their
pattern.

With rims, two of the ten that are held out changed, PSNR in dB before and after; none of the other
eighteen solids is taken for a plate or a cup. Nothing was chosen on the two, but that there is such
a thing as a cup on a saucer; what was looked at meanwhile is the photo of the coffee.

|  | turn 20 | turn 35 | pitch 20 |
| --- | ---: | ---: | ---: |
| plate | 16.1, 21.8 | 13.9, 20.1 | 13.4, 19.5 |
| cup | 19.8, 26.9 | 17.8, 24.3 | 18.6, 27.1 |
| **mean of the ten held out** | 18.0, 19.3 | 15.5, 16.8 | 17.2, 18.7 |

Where a turned cup was wrong was mostly its lip: of that the outline shows an arc only, and it was
thought to lie about the saucer's middle. The coffee's was 16 px too high in front, so the
white of the porcelain hung down the turned wall. Now a lip is where the photo's edges are, and the
cup has an axis of its own; its walls and its saucer have the colours that they have elsewhere where
the photo is drawn out; what is hidden ends in lines as the outline does; and what sticks out beyond
the saucer beside the lip, a spoon, lies as the saucer does. The serration of about a pixel at plate
and cup was the staircase of the silhouette's cells, along which the rim's points lie: 1.5 cells
did not even it where the outline is nearly level. Four do, but for corners, by a filter that does
not shrink (Taubin 1995): the plain one cost the ring 0.4 dB. Evening the depth along the rim did
nothing, and four times as many Gaussians take the plate's wobble from 1.55 to 1.42 only. PSNR in dB
and wobble, before and after both; the photo of the coffee was looked at meanwhile, and the cup, on
which a lip without bounds failed:

|  | before: turn 20 | turn 35 | pitch 20 | after: turn 20 | turn 35 | pitch 20 |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |
| plate | 23.2, 1.51 | 22.3, 1.54 | 21.5, 1.45 | 23.2, 1.43 | 22.2, 1.49 | 21.6, 1.40 |
| box | 23.9, 1.71 | 22.8, 1.85 | 23.1, 1.71 | 23.9, 1.66 | 22.6, 1.87 | 23.1, 1.70 |
| cup | 27.3, 1.45 | 24.7, 1.70 | 28.0, 1.63 | 27.2, 1.43 | 24.9, 1.81 | 28.4, 1.53 |
| ring | 18.8, 1.46 | 16.8, 1.20 | 17.5, 1.28 | 18.9, 1.37 | 16.9, 1.15 | 17.5, 1.28 |
| ball | 26.9, 1.24 | 23.7, 1.30 | 26.1, 1.20 | 26.5, 1.22 | 23.6, 1.18 | 26.0, 1.25 |
| duck | 18.5, 1.06 | 16.6, 0.92 | 18.1, 1.02 | 18.5, 1.05 | 16.6, 0.91 | 18.1, 1.01 |
| bunny | 14.7, 0.85 | 12.7, 0.78 | 15.5, 1.20 | 14.7, 0.84 | 12.7, 0.78 | 15.5, 1.22 |
| teddy | 17.9, 0.99 | 15.2, 0.87 | 18.0, 1.03 | 17.8, 0.98 | 15.2, 0.84 | 18.0, 0.99 |

Plate, box, ring and ball are with corners from 0.25 cells on; with 0.7, as the other rows are, the
box lost up to 0.3 dB. The rest of the twenty was not measured before and after.
The points of a surface lie otherwise afterwards, and another seed alone moves the ring by 0.1 to
0.3 dB: the ball's 0.4 dB at 20 degrees and the plate's 0.1 at 35 are as large as that, and were
not looked into. The cup's wobble at 35 degrees did not fall.

Heeding more of the waves that the network sees behind loses 0.1 to 0.2 dB (the duck gains as much,
the ball loses 1.8).

Newly shown sides were plain colours; now they are invented pictures
([how](../concepts/photo-texture.md)). Means over the turns by 20 and 35 degrees to both sides and
the pitches by 20 of five solids, before and after:

|  | PSNR, dB | SSIM | streaks | flat |
| --- | ---: | ---: | ---: | ---: |
| box | 22.07, 22.17 | 0.739, 0.735 | 0.212, 0.143 | 0.095, 0.015 |
| duck | 17.75, 17.81 | 0.866, 0.863 | 0.029, 0.014 | 0.109, 0.053 |
| mug | 16.05, 16.02 | 0.512, 0.488 | 0.077, 0.018 | 0.216, 0.023 |
| ball | 25.56, 25.26 | 0.796, 0.776 | 0.118, 0.072 | 0.166, 0.046 |
| teddy | 17.01, 16.96 | 0.533, 0.526 | 0.059, 0.029 | 0.091, 0.050 |

Texture that is invented is never the true one: on the ball it costs 0.3 dB. What is left of streaks
is mostly the photo itself, where it is stretched less than threefold. Duck and teddy are of an
earlier run, in which the pictures took over from a stretch of 2.2 on.

## What a turn is to be believed

A sign beside the gizmo and a report give the *risk* of a turn: the share of what is seen that the
photo did not show, and four times how far the rest is expected to be off; half of it for what was
recognised as a plain shape. Its numbers were chosen on box, mug, duck and ring: there it ranks 1 -
IoU of twenty turns with a Spearman coefficient of 0.82, and PSNR with 0.74. On ball, brick, bunny,
figure, robot and teddy, on which nothing was chosen, it is 0.62 and 0.62 of thirty turns; SSIM it
ranks with 0.35 only. Below 0.25 the sign is *fine*, from 0.5 on *guesswork*. What one part of an
object hides of another counts as invented although it may stay hidden.

`python docs/lifting/sheet.py` turns sixteen photos and measures them.

![Sixteen photos, turned by 15, 25 and 35 degrees to both sides and pitched by 20](turned.jpg)

Up to 25 degrees the flower, the rocket, the bowl, the coins and the logo look right, the astronaut
and the coffee nearly so: her head is a little deep, and what is not shown of hair and collar is
plain; the coffee's handle and spoon lie flat on the saucer, the upper end of the spoon's bowl is
smeared where it covers the cup, and what turns into view of the cup's side is blurred.
The horse is a sheet, as it was drawn. What does not look right: from 25 degrees on a band along the
cheek of the cat, whose outline is wavy there; the fig in the bowl becomes narrow, and slides at 35;
the photographer's back has a grey band; the clock, which is blurred, has a double edge; the retina
and the colour ball, which fill their photos, get corners; the pagoda is selected in part, and
leans; of the moon and of the cell a piece of ground is selected, which has a ragged edge. Nothing
is torn. Streaks or flat places are more than 2 % of what is newly shown on all but horse, coins,
moon and logo, and wobble is above 1.2 of colour ball (1.5) and bowl (1.25) at the worst of eight
turns; of the coffee, which was above 1.6, it is 1.23. The other rows are older than what made that
so, and are to be drawn again.
"""
STEREO = """## A photographed thing whose shape is known

The motorcycle of the Middlebury 2014 stereo pair (as scikit-image fetches it): the left photo is
lifted and seen from the right camera. The mask is what rises above the floor's plane in the true
disparities; where they are not known nothing is compared. The median disparity is given to all
ways, the field of view is the true one. Its spokes and cables are thinner than a silhouette's grid
can tell, and all ways carry the floor that shows through them.
"""
REAL = """## Photos

Lifted from a click (the motorcycle under its true mask) with the default settings and turned. There
is no truth to compare with: look at them. What the photo did not show is invented: the background
by the inpainter, sides and backs by the rule below.

![Photos with their object turned](photos.jpg)

## Backs

Of what is seen from the side, or looks like a box, the back is the front's mirror image. Of what
looks the same left and right, a face, it is grown from the rim, which is what turns into view
first. The lifter chooses; the artist may say otherwise (`--back`).

![Backs, mirrored and continued](backs.jpg)

## Thickness

`--thickness` makes the object thinner or thicker; in the editor it follows the slider at once.
At rest the photo stays the photo.

![Thickness](thickness.jpg)
"""
LIMITS = """## What falls short

- The network sees 224 pixels of the object: eye sockets, fingers and spokes are too small for it.
  A brush in the editor lets one paint what is nearer, and a larger network sees it:
  `objectmorpher models add depth FILE.onnx`. None is installed for this page; "depth" above is the
  relief with the true depth, up to scale and shift.
- What touches the ground in several places is taken to stand on them. An object that does not
  stand at all may be turned wrongly; `--floating` says so.
- A prism is recognised by straight upright sides and a corner or a curve below; seen exactly from
  the front, or from more than 31 degrees above, it is lifted as any other thing.
"""


def write_page(rows: list[Row], depths: Depths, stereo: list[Result]) -> str:
    solids = ["## Ten solids\n", _means(rows), _table(rows), "![Six of them](solids.jpg)\n"]
    seen = [DEPTH, _depth_table(depths)]
    return "\n".join([HEAD, *solids, *seen, OUTLINES, STEREO, _stereo_table(stereo), REAL, LIMITS])


def _means(rows: list[Row]) -> str:
    found = means(rows)
    lines = [_line(["", *GROUPS]), _line(["---", *["---:"] * len(GROUPS)])]
    lines += [_line([way, *(_cell(found.get((g, way))) for g in GROUPS)]) for way in WAYS]
    return "Means over the ten: IoU, PSNR in dB.\n\n" + _block(lines)


def _table(rows: list[Row]) -> str:
    head = ["", *(f"{way}, {group}" for group in FAR for way in TOLD)]
    lines = [_line(head), _line(["---", *["---:"] * (len(head) - 1)])]
    for row in rows:
        lines.append(_line([row.name, *(_cell(row.scores[g, way]) for g in FAR for way in TOLD)]))
    return "Each of them:\n\n" + _block(lines)


def _depth_table(depths: Depths) -> str:
    head = ["", *(f"{way}: front" for way in SURFACES), *(f"{way}: thickness" for way in SURFACES)]
    lines = [_line(head), _line(["---", *["---:"] * (len(head) - 1)])]
    cells = {
        name: [getattr(row[way], part) for part in ("front", "thickness") for way in SURFACES]
        for name, row in depths.items()
    }
    cells["**mean**"] = list(np.mean(list(cells.values()), 0))
    lines += [_line([name, *(f"{cell:.3f}" for cell in row)]) for name, row in cells.items()]
    return _block(lines)


def _cell(score: Score | None) -> str:
    return "" if score is None else f"{score.iou:.3f}, {score.psnr:.1f}"


def _block(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def _stereo_table(stereo: list[Result]) -> str:
    head = ["", "PSNR, dB", "SSIM", "disparity, RMS error, px"]
    lines = [_line(head), _line(["---", *["---:"] * 3])]
    for r in stereo:
        lines.append(_line([r.name, f"{r.psnr:.2f}", f"{r.ssim:.3f}", f"{r.disparity_error:.1f}"]))
    return _block(lines)


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
