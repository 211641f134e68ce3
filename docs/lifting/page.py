"""The text of the page. Its numbers come from what it is given."""

from __future__ import annotations

import numpy as np
from depths import WAYS as SURFACES
from motorcycle import Result
from sheet import Row as PhotoRow
from solids import HELD_OUT, SOLIDS
from turned_looks import Look
from turning import EDITS, GROUPS, WAYS, Row, Score, means

from objectmorpher_research.training import shape_eval

FAR = ("turn 20", "turn 35")  # of which every solid is told
TURNED = ("turn 20", "turn 35", "pitch 20")
TOLD = ("network", "relief", "card", "affine")  # likewise
Depths = dict[str, dict[str, shape_eval.ShapeError]]

HEAD = """# Lifting, measured

Made by `python docs/lifting/make_lifting.py`, which takes half an hour: every table is of that run.

The embedded lifter (`--lift relief`) makes a closed shape from one silhouette and from what our
[shape network](../shape_network/README.md) sees inside it. Then it tries to explain what it sees by
a few plain shapes: a box, an ellipsoid, a ring, a surface of revolution whose profile is read off
the outline. The one that describes the object in the fewest words takes the place of the network's
surface as far as it explains it, rights how the whole leans, and gives the far side that no photo
shows; where none does, the shape stays free. Whether the object is a flat sheet the network says
outright; what has a handful of colours, each the same all over, is a drawing, and flat, too: no
light falls on it. An outline that is mostly one ellipse is the rim of a plate or a bowl, and a
second, nearer circle is the lip of a cup; where the far half of what the ellipse encloses is steep,
it is the hole of a ring seen aslant. A handle lies in a plane through the axis of what it is on.
`--shape`, or Kind in the Shape panel, overrules all that.

How much of the truth is that? Solids whose every view is known are drawn into a photo (512 px, 50
degrees of view, over a blurred picture, seen from 6 to 18 degrees above, the ring from 50), lifted
with the default settings under their exact mask, and edited: turned by 10, 20 and 35 degrees to
both sides about the camera's axis, spun by 20 and 35 about their own upright (which the product
has to find), pitched by 20 both ways, brought nearer by three tenths of their distance, and bent by
40 degrees towards the camera and away (all control points are led along the same bend). The
lighting is painted on. What comes out is compared with the true view:

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

Seven of the ten are meshes of the package pybullet (zlib licence), which are fetched and not kept
here; the figure, the mug and the box are made by `solids.py`. Thresholds of the lifter were chosen
while looking at these ten, so they say what the method can do rather than what it will do. The
network was trained on none of them.
"""
DEPTH = """## Their surfaces

How far the fronts are from the true ones, over each solid's mean thickness, after the best scale
and shift; seen from eight sides each. *inflation* is the relief without looking how things stand,
*flat* a board as thick as that is on average.
"""
OUTLINES = """## Outlines and newly shown sides

The product alone, on the ten and on ten further solids (`HELD_OUT` in `solids.py`). Nothing was
chosen on those but for plate and cup, which were looked at while rims and lips were made; the
lamp's numbers were seen once while free forms were closed at their outline. How much evidence
makes a thing wholly the plain shape that it looks like was chosen on ball, box, brick, mug, ring
and robot. Eight of those held out were looked at afterwards: vase and beaker changed, and gain
0.1 dB. Where rims lie was chosen on box, brick, mug and ball; how a shape's sides go on beyond
their common edge was found on the beaker. Domino and card were looked at while boxes were fitted to
their outlines, and lamp, vase and beaker while profiles got steps. Means over both directions of a
turn; `make_lifting.py quick NAME ...` prints each turn of one.

- **Wobble**: the total absolute curvature of the outline over the true one's (evenly resampled,
  smoothed by 1 % of the square root of the area, without the frame). 1 bends as the truth does.
- **Streaks**, **flat**: the shares of the newly shown surface that are drawn out along one
  direction, or flat, beyond what 2 % of the object's own surface are.
"""
LOST = """\
Where the rest is lost was measured before rims were looked for, by putting parts of the true front
in the place of the network's. With the true lean (the plane nearest to the front) a turn by 20
degrees gains 0.7 dB on the ten and 1.6 on those held out, with the true shape (what is left of it)
0.8 and 0.9, with both 3.5 and 4.6; the best depth scale gains nothing. Where nothing is recognised
the network sees too little lean: on 150 views of other meshes the truth leans 1.8 times as much. So
from 9 degrees on, and wholly from 14 on, 1.2 times what is seen is added; what it sees to lean by
less is as often something else.

Where the waves of a turned outline come in was measured stage by stage, as its wobble before the
turn. On box, brick, mug and ball the mask bends 1.4 to 2.2 times as much as the true outline, the
matte's half 1.00 to 1.02 times, rims that are evened from the mask 1.08 to 1.29, the object at rest
1.00 to 1.02; with the true alpha in the matte's place the turned outline is as before. So the waves
were the surface's: its rim stood on the mask's steps of a pixel, its points filled the mask's last
cells, and its normals there were those of steps. Now rims lie where the matte is half covered,
sheets end there, walls have the rim's normals, and a recognised shape goes on beyond where its own
picture ends. At turn 20, turn 35 and pitch 20 the wobble of the ten was 1.32, 1.42 and 1.36 before,
and 1.40, 1.41 and 1.63 of those held out. What was left of box and brick was at
hidden corners, and at sides of which the photo shows a sliver: a pixel there is ten on the side.
Since the front of a recognised box lies on the box, too, and rows of points along its edges are
straight wherever they are, a pitch of the brick by 20 degrees bends 1.35 times as much as the truth
(1.93 before), of the box 1.37 (1.62), of the domino, held out, 2.05 (2.08).

What sticks out of a surface of revolution and is thin, a handle or a spout, is a round rod in a
plane through the axis. How that plane lies about the axis the shape network does not see: of
handles at -33 to 41 degrees to the side it says 1 to 23. So three small networks look at the handle
and at the body beside it (`objectmorpher_core/models/rods.onnx`, 0.6 MB, Apache-2.0, SHA-256
`0a311cb6f459af978525b70d7cbabd507de129b04c8c5708b2e83fe0b32b8de5`). They read the tokens that the
shape network reads, and were trained in seven minutes on 2,752 handles of made-up vessels
(`objectmorpher train rods`; making those takes half an hour on two cores). Of 320 that were held
out they are off by 5.8 degrees in the median and by 12.0 in the root mean square, of the surer half
by 5.4 and 8.6; the azimuths spread by 29. One network alone is off by up to 12.8. Where they expect
to be off by more than 20 degrees, the handle stays as it was.

On four vessels at five azimuths each, with which the rods were made and by which the three networks
were preferred to one (they are unlit, and so harder than photos: 8.9 degrees off), a turn by 20
degrees goes from 18.0 dB and an IoU of 0.883 to 20.2 and 0.927, a turn by 35 from 16.6 and 0.844 to
18.2 and 0.892; with the true azimuth it would be 21.1 and 0.941, and 18.9 and 0.912. On two others
at three azimuths each, on which nothing was chosen, from 18.7 and 0.904 to 20.1 and 0.934, and from
17.1 and 0.859 to 18.2 and 0.900. The mug of the table was at 16.3 and 0.837.

A box is fitted to what the network sees on a coarse grid, and then once more to its outline, whose
six corners say nearly all of it. What the network sees at such a box's corners counts less then,
and the sides that the photo does not show lie on the box itself, in line along its edges: sheets
over the photo's cells have holes where a side is seen edge-on. Of sixteen further boxes on which
nothing was chosen (random sides and views, half of them with round edges, half of their masks off
by a px) a turn by 20 degrees came out at 21.0 dB and an IoU of 0.913 before and at 25.6 and 0.954
now, a turn by 35 at 19.2 and 23.0 dB, a pitch by 20 at 19.7 and 24.0. Box, brick, domino and card
were looked at while this was made; a turn of the latter two by 20 degrees was at 17.7 and 17.2 dB.
The same for surfaces of revolution gains 0.2 dB on ball and ring and costs the vase 0.6; it is left
out.

A profile read off at 24 places, and smoothed, cannot follow a lamp's shade, and a goblet's foot on
its stem was taken for a handle. Of 40 made vessels and 80 other made things on which nothing was
chosen 22 of the vessels are found (16 before) and 7 of the others are called round (5 before; both
further ones came nearer to the truth). Of a lid that is seen nearly edge-on the network
sees little: how far it is off from a shape is measured across that shape, not along the rays.

The network looks at an object and at its mirror image, and the mean of both is used: what it gets
wrong in one it seldom gets equally wrong in the other. Before, fronts were off by 0.182 and
thicknesses by 0.350, and a turn by 20 degrees came out 0.2 dB lower, of those held out as well.

What gained nothing and went out again: to heed more of the waves that the network sees behind (the
ball loses 1.8 dB), to even the depth along the rim, to let the middle go on as a plane beyond the
outline, four times as many Gaussians (the plate's wobble falls from 1.55 to 1.42 only), to even
corners as the rest of an outline (the box loses 0.3 dB), and two further looks at a crop that is
wider by 15 % (thicknesses are off by 0.347 then). Another seed alone moves the ring by 0.1 to
0.3 dB. Newly shown sides are [invented pictures](../concepts/photo-texture.md), which are never
the true ones: on the ball they cost 0.3 dB against a plain colour.

Where such a picture is plainer than the object, texture is quilted over it, and what a soft edge
mixes (fur lit from behind, hair, blur) is replaced from farther in: what is drawn out over a side
when an object turns by 25 degrees is the outermost twentieth of it. Fourteen further photographs
(animals, people, fruit, buildings; none of them is on a page here) were lifted by one click, turned
by 25 and 35 degrees to both sides and by 20 up and down: streaks fell from 6.2 to 5.6 % of what is
newly shown, and flat places from 8.6 to 6.3 %. Of the eight among them on which nothing was chosen
streaks fell from 6.0 to 5.8 %, and flat places from 6.2 to 5.0 %. A quokka's side, lit from behind,
was a pale band before; a lion's mane, a dog's ear and the peel of an orange were smooth. The
solids, whose edges are crisp, lose 0.03 dB of a turn by 20 degrees and nothing of those held out.
To change from the photo to the invented picture earlier, at a ratio of 0.55 instead of 0.4, lets an
eye come twice. Quilts alone, without the completion beneath, break the stripes of a vase.

Where the matte is soft, hair is mirrored at its rim over the side, which is drawn as it looks after
a turn by 45 degrees and takes the photo's place sooner there. Of a corgi, a collie, a cat and a
teddy that were turned by 25 degrees a pale or clay-like band beside the outline is gone or much
narrower, and no eye or nose comes twice; this was chosen on them. A toy wolf, on which nothing was
chosen, changes little: it had no such band. A quokka, lit from behind, got a pale side by it, until
a fringe that is lighter than what lies inside it was taken for as deep as before. Eight solids,
whose edges are crisp (box, domino, card, mug, brick, cup, ring, vase), come out 0.1 dB higher of a
pitch by 20 degrees, 0.1 lower of a turn by 20 and the same of one by 35; the domino loses 1.0 dB to
one side.

Later the side's picture took the photo's place there already from a ratio of 0.7 instead of 0.6:
hair that the background shines through had shown it in streaks. Of eleven animals and people,
turned by 12 and 25 degrees each way, 2.6 % of the pixels that change were nearer to the colours of
the background than to the object's, and are 1.5 % (no more in 38 of the 44 views). It was seen on
an alpaca, of whose right side it was 2.6 % and is 0.7 %. A ratio of 0.8 gains as much again, but
draws a brown line along the white booster of the astronaut's shuttle, which is out of focus.

Where one part stands before another, as a cup on its saucer, the photo goes on up to the line where
they meet; before, both had plain colours there as soon as they were moved, also where a handle or a
spoon reaches over it. The cup of the samples, moved by 8 and 5 px, differs there from the photo by
2.0 levels of 255 instead of 4.5 (elsewhere by 1.3), moved by 30 and 20 px by 2.8 instead of 5.1. A
drawn cup on a saucer, turned by 20 and 35 degrees, keeps its figures to 0.1 dB.

What stands out, an eye or a nose, is not there twice; but of a striped or spotted coat nearly
everything stood out, two thirds of a tabby, and its side stayed plain. Now at most the 7 % of a
surface that are most unlike their surroundings stand out, with what lies close around them; the
rest is a pattern. Of 14 photographs of animals and people that were turned by 25 degrees to both
sides, all of them in view when that was chosen, a tabby, a giraffe, a tiger and an eagle have their
pattern on their sides, and the others look no worse.

A side that turns into view is smooth, and hair ended there as clay does, in a hard, wavy line. Now
strands are rooted on it, thin Gaussians as long as the photo's own hair is soft, as many as its
outline is ragged, and in the side's colours. What is ragged is seen by the matte: across a smooth
edge alpha changes along its normal alone, however soft the edge is, and where hair ends it changes
from strand to strand. An object whose outline is ragged by less than a fifth on average gets no
hair: it has nicks, as the astronaut's collar has, or little hair that would change anything. Of 37
things in photographs nearly all animals and plush toys and two people of three get some, and a boot
with fringes; of other things a glass jar, a robot before a rock and a pagoda, where one does not
see it at a glance. None of the twenty solids gets any. At rest strands are not seen, they are no
part of the body, and an object with 6,000 of them takes about a third longer to draw, turned by 25
degrees. Their length and lean were chosen so that the outline of seven animals and plush toys,
turned by 15 and 25 degrees and pitched by 20, bends as it does at rest: before, it bent 0.40 to
0.92 times as much (0.64 on average), now 0.58 to 1.14 (0.80). Of six others, on which nothing was
chosen, it was 0.45 to 0.92 (0.67), and is 0.47 to 1.21 (0.73); long human hair, which falls in
curves, gains least. Where the back is the mirror image, strands show the photo, too: a wolf goes
from 0.52 to 0.71 to 0.63 to 0.82, a dachshund from 0.33 to 0.52 to 0.44 to 0.55. A corgi, a collie
and a giraffe, whose edges are blurred or short-haired, keep their smooth outline.

Whiskers and hair that stands off farther than a soft edge reaches are looked for beside an
outline that is ragged: ridges of lightness one or two pixels wide, alike on both sides, which
begin at the cut-out and end nearby, unless the background is full of such lines
(`objectmorpher_core/lift/loose_hair.py`). They are a part of the cut-out, and stand as deep as
the outline beside them; the shape is made without them. How much of a pixel a hair covers
cannot be seen, only that times its contrast: it is taken to be a quarter more than the least
that is possible, so that nothing of the background comes along. The more ragged an outline is,
the less hair is needed as evidence. Of 45 photographs, on which that was chosen, ten have such
hair: seven animals, two people and a boot with fringes. Until the outline was asked, lines
beside the solid in 37 of the 63 cases of [the benchmark](../evaluation.md), and beside a can, a
pick-up and a camera, were taken for hair; now none. Of a made furry ball with twelve long hairs
more than four fifths of their length goes along.

A mask that was drawn around hair takes in the background between it, which stood beside a
turned head as a shell. Where the mask lies on no edge of the picture and colours agree, the
matte is now looked for three times as far from it, and the body ends where the object is solid;
the brim carries the rest. Of what is seen of a made furry disc, turned by 25 degrees, 5 % have
the ground's colours instead of 24. Of six photographs of animals and people an alpaca's fleece,
a horse's head and tail, one side of a man's hair and a corgi's side have lost their shells; hair
before leaves has not. Gaps count that are three times as deep as a mask's edge is off elsewhere.
Twice as deep, a can, a candle and a bag would lose what only looks like the background. The
composites of [matting](../matting/README.md), whose masks fit, stay as they were.

The strands of a mane reach the mask's edge, and that is an edge of the picture. The background
shows between them where the wide matte sees through, and what is there is unlike all of the
object near by, like the background, a mixture of both, not the same from strand to strand, and not
deep inside. Of 62 masks of photographs, all of them in view when that was chosen, seven change: a
horse's mane and tail, a lion's mane, the arms of a lamp and the columns of a pagoda are free of
what was behind them; a tripod's leg is a little thinner. Without the last three conditions a dark
collar before a dark roof, a white rim before leaves, and a tabby's stripes before black would go;
with them all scores of matting are as they were.

## Beyond the photo's frame

An object that the frame cuts goes on beyond it by an eighth of its size, for it may be turned or
moved. The strip is filled with patches of the object beside it. `python docs/lifting/beyond.py`
cuts photos through their object, on each of its sides; what was cut off is the truth. *unlike* and
*HED* are those of [compositing](../compositing/README.md): less is better. The numbers of this were
chosen on the sixteen photos below; things outlined by hand were held out.

| | | PSNR | SSIM | unlike | HED |
| --- | --- | ---: | ---: | ---: | ---: |
| 56 cuts, chosen on | mirrored | 17.2 | 0.483 | 0.138 | 0.308 |
| | patches | 19.1 | 0.526 | 0.109 | 0.274 |
| 31 cuts, held out | mirrored | 14.1 | 0.360 | 0.105 | 0.359 |
| | patches | 16.0 | 0.428 | 0.086 | 0.314 |

Of those held out, patches are nearer in 90 % by PSNR and in 81 % by HED. Mirror images, as they
were before, show eyes twice and let whiskers meet. Straight lines that are drawn on change nothing:
a strip has no other side to which they lead. Without what coarse colours to expect (half the mirror
image's, half a smooth continuation) a badge comes twice where cloth should be.

## What a turn is to be believed

A sign beside the gizmo, a report and the command's notes go by the share of what is seen of the
object that the photo did not show: below 6 % it is *fine*, from 20 % on *guesswork*. It was chosen
by looking: 108 turns of eighteen photos, by 10 to 30 degrees, of which 36 look right, 39 will do
and 33 do not. On nine photos, on which 6 % was chosen, it speaks at 16 of the 19 turns that do not
look right and at 2 of the 17 that do; on the other nine at 12 of 14 and at 5 of 19. Of thirty turns
by 10, 20 and 30 degrees of ten photos below, nearly all of which look right, it speaks at 7: all
three of the rocket, two of the horse, and the farthest of china and camera. What it misses is bent,
not invented; where it speaks for nothing, a pattern hides what is.

How far parts are expected to be off goes with the angle, whatever is turned: it ranks 1 - IoU of
108 turns of nine solids (box, card, cup, figure, lamp, leaf, mug, plate, vase) with a Spearman
coefficient of 0.09 and PSNR with 0.19, the share that is invented with 0.55 and 0.48. Both
together, halved for what was recognised as a plain shape, gave 0.25 and 0.45, and spoke at 9 of
those 14 turns, at 10 of those 19 and at 11 of those thirty. How much of the background is filled in
says nothing about how that looks. What one part of an object hides of another counts as invented
although it may stay hidden.

## Sixteen photos

`python docs/lifting/sheet.py` turns them, as the Place tool does: what is seen to stand, as the cup
does, about its own upright. Wobble is that of the turned outline over that at rest.

![Sixteen photos, turned by 15, 25 and 35 degrees to both sides and pitched by 20](turned.jpg)
"""
LOOKED = """\
Each picture was looked at. The coffee spins on its table, which holds up to 35 degrees; at the
cup's limb are small jags, and a nib where the spoon touches the lip; its handle and spoon lie flat
on the saucer. Up to 25 degrees the flower, the rocket, the bowl, the coins and the logo look right,
the astronaut nearly so: her head is a little deep, and what is not shown of her neck is uneven. The
horse is a sheet, as it was drawn. What does not look right: the cat's fur at the upper
left is coarse; the side of the bowl that turns into view is drawn out at 35; the photographer's
back has a grey band; the clock, which is blurred, has a nub at its left, for its edge is taken for
hair, and the cell, which is blurred too, a hard one where its side turns into view; the retina
shows its dark spot a second time at its left; the colour ball is black at the frame, and has bands,
nicks and specks there; the pagoda leans, becomes narrow at 35, and shows light spots at its left
windows; of the moon a piece of ground is selected, which has a ragged edge.
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


def write_page(
    rows: list[Row],
    looks: dict[str, dict[str, Look]],
    photos: list[PhotoRow],
    depths: Depths,
    stereo: list[Result],
) -> str:
    """`looks` by the solid's name and the turn's, those of the ten and of the ten held out."""
    solids = ["## Ten solids\n", _means(rows), _table(rows), "![Six of them](solids.jpg)\n"]
    seen = [DEPTH, _depth_table(depths)]
    turned = [OUTLINES, _looks_table(looks), LOST, _photo_table(photos), LOOKED]
    return "\n".join([HEAD, *solids, *seen, *turned, STEREO, _stereo_table(stereo), REAL, LIMITS])


def _looks_table(looks: dict[str, dict[str, Look]]) -> str:
    measures = ("dB", "wobble", "streaks", "flat")
    head = ["", *(f"{group}: {measure}" for group in TURNED for measure in measures)]
    lines = [_line(head), _line(["---", *["---:"] * (len(head) - 1)])]
    cells = {name: _look_cells(own) for name, own in looks.items()}
    for title, names in (("ten", SOLIDS), ("held out", HELD_OUT)):
        lines += [_look_line(name, cells[name]) for name in names]
        mean = np.mean([cells[name] for name in names], 0)
        lines.append(_look_line(f"**{title}**", list(mean)))
    return _block(lines)


def _look_line(name: str, cells: list[float]) -> str:
    formats = (".1f", ".2f", ".2f", ".2f") * len(TURNED)
    return _line([name, *(f"{cell:{how}}" for cell, how in zip(cells, formats, strict=True))])


def _look_cells(own: dict[str, Look]) -> list[float]:
    """The measures of each group of turns, means over its turns."""
    found: list[float] = []
    for group in TURNED:
        looks = [look for key, look in own.items() if EDITS[key].group == group]
        measures = [(k.score.psnr, k.wobble, k.smear.streaks, k.smear.flat) for k in looks]
        found += [float(value) for value in np.mean(measures, 0)]
    return found


def _photo_table(photos: list[PhotoRow]) -> str:
    """The worst of each photo's eight turns."""
    lines = [_line(["", "wobble", "torn", "streaks", "flat"]), _line(["---", *["---:"] * 4])]
    for name in dict.fromkeys(row.name for row in photos):
        own = [row for row in photos if row.name == name]
        worst = np.max([(r.wobble, r.torn, r.streaks, r.flat) for r in own], 0)
        lines.append(_line([name, *(f"{value:.2f}" for value in worst)]))
    return (
        "The worst of each photo's eight turns; *torn* is the share of the area that came off.\n\n"
        + _block(lines)
    )


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
