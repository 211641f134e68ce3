"""The text of the page, and its tables."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from focus import Focussed, Sharp
from grains import ADDED, RINGS, Grained
from lights import Turned
from places import WORSE, Moved
from plate_times import Taken
from plates import BLUR, HOLES, OTHER_HOLES, OTHER_WAYS, WAYS, Filled
from shadows import Shaded

from objectmorpher_core.models import registry

IMAGINED = Path(__file__).resolve().parent / "imagined.json"  # what `imagined.py` counted
IMAGINED_WORDS = {
    "none": "no shadow of the thing", "large": "large true shadows",
    "visible": "of these, visible in principle",
}  # fmt: skip
HEAD = """# Putting it back, measured

Made by `python docs/compositing/make_compositing.py`; every number comes from that one command.
"""
LIGHT = """## Light that stays while a thing turns

Ten solids (those of [lifting](../lifting/README.md)) are drawn in linear light under one lamp and
light from all around, lifted, and turned by 20 to 35 degrees; the lamp stays. The truth is drawn,
too. *plain* carries the photo's pixels along as they are; *harmonised* is the same with Harmonise
at its usual strength. Root mean square errors over all that either covers, the edge included, from
which most of it comes: where a solid's shape is guessed wrong no light helps.

{summary}

{table}

![The photo, turned without, harmonised, and true](lights.jpg)
"""
PLACE = """## The light of a new place

A photo is multiplied in linear light by a light that varies over it, and so is a solid in it; then
the solid is moved from one side to the other, and its truth is known. Thirteen backgrounds (six of
one material, seven photographs, which have many), four solids, both ways. Root mean square errors
over the solid in levels of 255, plain → Harmonise's *Place* at its usual strength.

{summary}

{table}

What the light is and what the material is, nobody can tell for sure from two mean colours: where
photographs differ within each place, or are of colours that no lamp has, little is changed, and
that much too little where the light is truly another. In one material it helps most. How much doubt
counts was chosen on these very cases, so that none of them becomes worse.
"""
GRAIN = """## Grain

A disc with noise that is known is moved; what noise its picture then has, over what the photo has
(1 is right): deviation in all, and by the spectrum coarse (below 0.1 cycles per px), middle, and
fine (from 0.25). Plain → Grain at 1.

{table}

What moves is as fine-grained as the photo again. Coarse noise that enlarging has made of fine
cannot be taken away: there the deviation in all becomes too large.

How strong noise is found to be, over what was added, in photographs without any:

{found}

Gravel has no flat place, and its texture is taken for grain; it is given at most 12 levels.

![Noise in the photo, moved by half a pixel, smaller, larger: without grain and with it](grains.jpg)
"""
FOCUS = """## Focus

A thing on a ground that is in focus where the thing stands goes nearer or farther on it. How
blurred the ground is there is known: px of the photo, true → found. 0 is what is not sure, and
stays as sharp as it was.

{summary}

{table}

{sharp}

What is found is rather too little: crowded texture looks sharper than it is, and where the ground
at the thing's foot looks softer than the thing itself (brick), nothing is taken to be sure.

![The thing gone farther: as sharp as it was, as Focus has it, as it should be](focus.jpg)

"""
SHADOW = """## The old shadow

The solids stand on grounds with photographed textures, each under three lamps that throw a shadow
one sees. Mean differences, in levels of 255, from the ground in full light: in the shadow as it is
in the photo, as it is after it was found and taken off (`--shadow auto`, Shadow as in the photo),
and beside it, where nothing should change.

{summary}

{table}

![The photo, without the shadow it was found to have, and as it truly is](shadows.jpg)

Two of the constants by which the light at a shadow's edge is evened were settled with these cases
in view. What is not found stays, and can be painted out of the background (B). A ground with marks
of its own as large as a shadow hides it; so does an outline that stands nowhere.

A shadow is looked for in two ways. Shadows of the thing's own silhouette are laid on the ground in
all directions and lengths, and what explains the photo best is asked how much speaks for it. And a
small network sees the same surroundings: a U-Net of 0.64 million weights that reads 96 x 96 cells
about the thing (`objectmorpher_core/models/shadow.onnx`, 0.7 MB, Apache-2.0, SHA-256
`{shadow_network}`). It was trained
from nothing at first, in 8,700 steps on 134,000 pictures of 2,900 made scenes, within two hours on
two busy cores (`objectmorpher train shadow`): things of boxes, balls, cylinders and boards, on
photographed and drawn grounds, under one or two lamps, with neighbours, walls, patches and shades
of something else; four in ten have no shadow of the thing. No solid and no scene on this page was
trained on, nor any photograph of the half below that was held out; parts of those of the other half
were, as grounds and backgrounds, the cup's photo among them. It was then trained on for 1,530 steps
on 16,000 pictures of 576 other scenes, at both scales (`--start`, `--grounds`), with 121 further
pictures of grounds and places that are not on this page, and the mean of the weights before and
after is what is used. Where the network sees shade says which of the shadows that were tried it is,
and how sure it is decides whether there is one, but for a silhouette that explains so much that it
is certain by itself. It looks four times: at what is there and at its mirror image, and at both 1.6
times as large; the mean is how sure it is.

Whether anything is imagined is asked of 1,000 scenes (`python docs/compositing/imagined.py`):
solids and upright pictures on photographed and drawn grounds, with walls, neighbours, edges of
another material and dappled light, of which more than half have no shadow of the thing. The half
that was held out has other seeds and shows other photos. A shadow is *large* that is darker than
12 % on a seventh of the thing's area or more. It is *visible in principle* if an observer could be
sure of it who knows its form and what the ground looks like without it: laid on the photo where it
is, the form explains more darkness than it does at 99 of 100 other places and turns on the ground
without the shadow.

{imagined}

The silhouettes alone, as they decided before, took 11 of the 295 for a shadow (3.7 %), and found 56
of the 185 (30 %), of those visible in principle 40 of 80 (50 %).

What was tried and is not used: bodies as deep as they are wide, a brightness of its own for each
colour of the ground, the steps of light along the shadow's edge, the same shape elsewhere on the
ground, and the side from which the thing itself is lit; and how far the network's shade and the
fitted one agree, as evidence. None of them finds more where equally many are imagined.
The further grounds are what helped: by the network alone, where 3 are imagined, it finds 125 large
shadows instead of 111 in the half for choosing, none of whose photographs were trained on further,
and 93 instead of 77 in the half that was held out. Trained on for 3,700 steps with the photographs
of before it was 122, but 74; the mean of all of these weights, the other network that was asked of
the held-out half, finds 128, but 84. The window's margin was set so
that no more are imagined in either half than before.

On photographs: the saucer's shadow, the motorcycle's, and a bowl's in the sun, seen from above. Its
shadow is its outline, beside itself, in the photo and where it goes; where its hard edge is, how
hard and how dark, the photo shows px for px. The edge itself, a few px that are neither lit nor
shaded and that the camera has sharpened, is filled in as a hole is: a line of 10 levels was left
there, now 2. What a JPEG file shows of a ground in deep shade is blotched and grainy, and calmed to
what lit ground shows.

![Photos with the shadow, without it, and with the thing moved and its new shadow](photos.jpg)

Reflections on a table or water are not looked for. A mirror image fitted to the photo took 29 of 36
off the ground that were made as light adds up, but of seven things in photographs that have a
reflection it found none: waves, grass and the side that the photo does not show. The brush (B) is
for them.
"""
PLATE = """## The background

Holes are cut where the background is known, and filled in. PSNR and SSIM in the hole say how near
the fill is to what was there, *unlike* how differently DINOv2 sees it (1 - cosine of its tokens),
*HED* how differently an edge detector's VGG16 does ([HED-VGG perceptual](../evaluation.md), which
minds texture and outlines more): a smooth blur is near and unlike, a sharp guess is far and alike.
*PatchMatch* is pypatchmatch at the photo's resolution, the others are OpenCV's.

{table}

![What was there, the hole, ours, PatchMatch, Telea, Navier-Stokes](plates.jpg)

{summary}

What is filled in comes, since this table was made, from the regions beside the hole: ground
goes on as ground, and a house as a house. Sources of another kind, by colour and roughness,
cost 4,000 squared levels at most. Of 40 holes in the form of objects, cut where nothing stands,
19 were chosen on and 21 held out. Of what is filled in there, the share that looks like another
region than what was there falls from 30 to 27 %, of those held out from 34 to 29 %; PSNR rises
from 18.7 to 19.2 dB and from 18.3 to 18.5, of the same blurred by 6 px from 22.2 to 23.0 and
from 21.9 to 22.5. Gravel alone, of one kind throughout, comes out 2 % smoother. A wide hole
between two regions still gets a boundary that wanders.

Where a thing meets the ground no light falls, and a fill from there is as dark: below a sports
car it became a hole with the windows of a house. A strip far darker than the ground below it
(0.45 of its light), which ends within 0.18 of the thing's shorter side and is as wide as a
third of its foot, is filled in with the thing, when that has left its place. Its four numbers
were chosen on 50 photographs, of which six have such a strip; one of the six is a dark tray
under a vase. Of 30 others four do, two cars and two shoes, and all four are strips. In one of
56 made scenes on which nothing was chosen, and in which the thing throws no shadow, something
else is taken for a strip. A foot that curves upwards at its sides, such as a lamp's on its
edge, has none that is found.

Holes in photos that none of the above are of (PSNR, SSIM, HED):

{others}

Ours searches a small picture, from coarse to fine, and takes the detail from the photo. Straight
edges that enter a hole on two sides go on through it, and the subject of the photo (as U²-Net-p
sees it; without its weights, colours that do not occur around the hole) is an unlikely source, so
that hair does not grow over the wall (*flag and wall*). Without the
edges that go on, the eight holes lose 0.4 dB and the ten 0.1; without the subject, the eight lose
0.4 and the ten nothing. A subject that is mostly the hole itself does not count: amid grass the
hole's smooth guess looks like one to the network, and made the grass around it an unlikely source,
so that a house's boards appeared behind a car in a meadow. The mean PSNR of 40 other holes, cut
where nothing stands, rises by 0.01 dB for it.
What patches say of large areas is one of
many answers: the colours of these are drawn a third of the way to the smooth mean of what is
around, edges and detail stay. It does not understand what it copies:
variants, the brush, and *Take from here* (Shift+B, or `--fill-from`) are for that. PatchMatch is
nearer mostly in *flag and wall* and *garage*, with a piece of the suit and a brown smear that
happen to be as bright as what was there. Patches carry which way a grain slants: its mirror image,
which showed as a herringbone (*table*), slants the other way. Its settings
were chosen on 49 other holes in the same photos and five more; how much the subject counts was
seen on *flag and wall* and *launch tower*, too, and how far colours are drawn (of two strengths and
two widths the best on the eight; any was better on the ten) on both tables. A wider margin of
sources was tried: 0.3 dB better on the eight, and 0.5 dB worse on the ten. Seconds are those of all
processors together.

{times}

Made by `python docs/compositing/make_compositing.py plates`, as is this section.
"""


@dataclass(frozen=True, eq=False)
class Measures:
    """All that the page tells."""

    turned: list[Turned]
    moved: list[Moved]
    grained: list[Grained]
    found: dict[str, list[float]]  # by photo, see `grains.found_on_photos`
    focussed: list[Focussed]
    sharp: list[Sharp]
    shaded: list[Shaded]
    filled: dict[str, dict[str, Filled]]
    taken: list[Taken]


def write_page(measures: Measures) -> str:
    turned = measures.turned
    return "\n".join(
        [
            HEAD,
            LIGHT.format(summary=_light_summary(turned), table=_light_table(turned)),
            place_section(measures.moved),
            GRAIN.format(table=_grain_table(measures.grained), found=_found_table(measures.found)),
            focus_section(measures.focussed, measures.sharp).rstrip("\n") + "\n",
            shadow_section(measures.shaded),
            plate_section(measures.filled, measures.taken),
        ]
    )


def place_section(moved: list[Moved]) -> str:
    return PLACE.format(summary=_place_summary(moved), table=_place_table(moved))


def shadow_section(shaded: list[Shaded]) -> str:
    return SHADOW.format(
        summary=_shadow_summary(shaded), table=_shadow_table(shaded), imagined=_imagined_table(),
        shadow_network=hashlib.sha256(registry.shadow_network()).hexdigest(),
    )  # fmt: skip


def _imagined_table() -> str:
    """Of what `imagined.py` counted."""
    counts = json.loads(IMAGINED.read_text(encoding="utf-8"))
    rows = []
    for kind, words in IMAGINED_WORDS.items():
        for half in ("chosen on", "held out"):
            whole, taken, offered = (
                counts.get(f"{half}, {kind}, {result}", 0)
                for result in ("in all", "taken along", "offered")
            )
            shares = [f"{count} ({100 * count / whole:.1f} %)" for count in (taken, offered)]
            rows.append([f"{words}, {half}", str(whole), *shares])
    return _table(["", "in all", "taken along unasked", "offered by the window"], rows)


def focus_section(focussed: list[Focussed], sharp: list[Sharp]) -> str:
    blurred = [case for case in focussed if case.far > 0]
    plain, soft = (np.mean([getattr(c, n) for c in blurred]) for n in ("sharp", "soft"))
    worse = sum(case.soft > WORSE * case.sharp for case in focussed)
    summary = (
        f"Where focus changes anything the composite is off by {plain:.1f} levels of 255 without "
        f"Focus, and by {soft:.1f} with it. Of {len(focussed)} cases {worse} are worse by more "
        f"than {100 * WORSE - 100:.0f} %; some blur is found in "
        f"{sum(c.found > 0 for c in blurred)} of the {len(blurred)} that have any, and in "
        f"{sum(c.found > 0 for c in focussed if c.far == 0)} of the others."
    )
    ratios = sorted({case.ratio for case in focussed})
    lines = ["| | " + " | ".join(f"depth x {r:g}" for r in ratios) + " |"]
    lines.append("| --- |" + " ---: |" * len(ratios))
    for ground, far in dict.fromkeys((c.ground, c.far) for c in focussed):
        own = [c for c in focussed if (c.ground, c.far) == (ground, far)]
        cells = " | ".join(f"{c.true:.1f} → {c.found:.1f}" for c in own)
        lines.append(f"| {ground}, {far:g} px | {cells} |")
    return FOCUS.format(summary=summary, table="\n".join(lines), sharp=_sharp_text(sharp))


def _sharp_text(sharp: list[Sharp]) -> str:
    """What photographs say whose focus is not known."""
    tried, blurred = sum(s.tried for s in sharp), sum(s.blurred for s in sharp)
    most = max(sharp, key=lambda s: s.most)
    return (
        f"{len(sharp)} objects of photographs, most of them sharp all over, were moved to "
        f"{tried} places and depths: {blurred} times one was blurred, by at most "
        f"{most.most:.1f} px ({most.name})."
    )


def plate_section(filled: dict[str, dict[str, Filled]], taken: list[Taken]) -> str:
    own = {name: filled[name] for name in HOLES}
    others = {name: filled[name] for name in OTHER_HOLES}
    return PLATE.format(
        table=_plate_table(own), summary=_plate_summary(own), others=_others(others),
        times=_times(taken),
    )  # fmt: skip


def _others(filled: dict[str, dict[str, Filled]]) -> str:
    """A table of holes in other photos."""
    measures = ("psnr", "ssim", "hed")

    def cell(found: list[Filled], digits: int = 1) -> str:
        psnr, *rest = (np.mean([getattr(f, name) for f in found]) for name in measures)
        return ", ".join([f"{psnr:.{digits}f}", *(f"{value:.3f}" for value in rest)])

    rows = [[name, *(cell([own[way]]) for way in OTHER_WAYS)] for name, own in filled.items()]
    mean = [cell([own[way] for own in filled.values()], 2) for way in OTHER_WAYS]
    return _table(["other photos", *OTHER_WAYS], [*rows, ["**mean**", *mean]])


def _times(taken: list[Taken]) -> str:
    parts = [f"{t.megapixels} MP in {t.seconds:.1f} s and {t.megabytes:.0f} MB" for t in taken]
    return f"A thing of a third of the photo's width, the program's memory: {'; '.join(parts)}."


def _plate_summary(filled: dict[str, dict[str, Filled]]) -> str:
    """In how many holes ours is at least as good as plain PatchMatch."""
    pairs = [(found["ours"], found["PatchMatch"]) for found in filled.values()]
    psnr, ssim = (sum(getattr(a, n) >= getattr(b, n) for a, b in pairs) for n in ("psnr", "ssim"))
    unlike, hed = (sum(getattr(a, n) <= getattr(b, n) for a, b in pairs) for n in ("unlike", "hed"))
    means = [[np.mean([getattr(f, n) for f in own]) for n in ("psnr", "blurred")]
             for own in zip(*pairs, strict=True)]  # fmt: skip
    (ours, ours_blurred), (plain, plain_blurred) = means
    return (
        f"Ours is at least as near as plain PatchMatch in {psnr} (PSNR) and {ssim} (SSIM) of "
        f"{len(pairs)} holes, and at least as alike in {unlike} (DINOv2) and {hed} (HED).\n\n"
        f"Detail that is not what was there costs PSNR however right it looks: blurred by "
        f"{BLUR:g} px, and worse to look at, ours is at {ours_blurred:.2f} dB instead of "
        f"{ours:.2f}, and PatchMatch at {plain_blurred:.2f} instead of {plain:.2f}."
    )


def _light_summary(turned: list[Turned]) -> str:
    ratios = np.array([case.ratio for case in turned])
    plain, relit = (
        np.mean([-20 * np.log10(getattr(case, name)) for case in turned])
        for name in ("plain", "relit")
    )
    worse = int((ratios > 1.05).sum())
    return (
        f"Over {len(turned)} cases: {plain:.2f} dB plain, {relit:.2f} dB harmonised. The error is "
        f"{100 * (1 - ratios.mean()):.1f} % smaller on average, {100 * (1 - ratios.min()):.0f} % "
        f"in the best case and {100 * (ratios.max() - 1):.0f} % larger in the worst; it is more "
        f"than 5 % larger in {worse} of them."
    )


def _light_table(turned: list[Turned]) -> str:
    names = list(dict.fromkeys(case.name for case in turned))
    lamps = list(dict.fromkeys(case.lamp for case in turned))
    rows = []
    for name in names:
        cells = []
        for lamp in lamps:
            own = [case for case in turned if (case.name, case.lamp) == (name, lamp)]
            plain, relit = (np.mean([getattr(c, w) for c in own]) for w in ("plain", "relit"))
            cells.append(f"{255 * plain:.1f} → {255 * relit:.1f}")
        rows.append([name, *cells])
    return _table(["levels of 255", *(f"lamp {lamp}" for lamp in lamps)], rows)


def _place_summary(moved: list[Moved]) -> str:
    ratios = np.array([case.ratio for case in moved])
    worse = [case for case in moved if case.ratio > WORSE]
    most = max((case.harmonised - case.plain for case in moved), default=0.0)
    plain, harmonised = (np.mean([getattr(c, w) for c in moved]) for w in ("plain", "harmonised"))
    return (
        f"Over {len(moved)} cases: {plain:.1f} → {harmonised:.1f} levels. In {len(worse)} of them "
        f"the error is more than 5 % larger, by at most {most:.1f} levels (one below one level "
        f"counts as one level); in {int((ratios < 1 / WORSE).sum())} more than 5 % smaller."
    )


def _place_table(moved: list[Moved]) -> str:
    rows = []
    for light in dict.fromkeys(case.light for case in moved):
        cells = []
        for is_plain in (True, False):
            own = [c for c in moved if (c.light, c.is_plain) == (light, is_plain)]
            plain, after = (np.mean([getattr(c, w) for c in own]) for w in ("plain", "harmonised"))
            worse = sum(c.ratio > WORSE for c in own)
            cells += [f"{plain:.1f} → {after:.1f}", f"{worse} of {len(own)}"]
        rows.append([light, *cells])
    return _table(["light", "one material", "worse", "photographs", "worse"], rows)


def _grain_table(grained: list[Grained]) -> str:
    rows = [
        [case.noise, case.place]
        + [f"{a:.2f} → {b:.2f}" for a, b in zip(case.plain, case.grained, strict=True)]
        for case in grained
    ]
    return _table(["noise", "moved", "deviation", *RINGS], rows)


def _found_table(found: dict[str, list[float]]) -> str:
    rows = [[name, *(f"{share:.2f}" for share in shares)] for name, shares in found.items()]
    return _table(["added, levels", *(f"{level:g}" for level in ADDED)], rows)


def _shadow_summary(shaded: list[Shaded]) -> str:
    found = [case for case in shaded if case.is_found]
    cast = [case for case in shaded if case.before > 0]
    before, after = (np.mean([getattr(c, w) for c in found]) for w in ("before", "after"))
    beside = np.mean([case.beside for case in found])
    imagined = sum(case.is_imagined for case in shaded)
    return (
        f"Found: {len(found)} of {len(cast)}. Where found, {before:.1f} levels become {after:.1f}; "
        f"beside it {beside:.1f}. On the same grounds without a shadow, {imagined} of "
        f"{len(shaded)} are imagined."
    )


def _shadow_table(shaded: list[Shaded]) -> str:
    names = list(dict.fromkeys(case.name for case in shaded))
    suns = list(dict.fromkeys(case.sun for case in shaded))
    rows = []
    for name in names:
        own = {case.sun: case for case in shaded if case.name == name}
        rows.append([name, *(_shadow_cell(own[sun]) for sun in suns)])
    return _table(["", *(f"lamp {sun}" for sun in suns)], rows)


def _shadow_cell(case: Shaded) -> str:
    if case.before == 0:
        return f"{case.ground}: hidden"
    after = f"{case.after:.1f}" if case.is_found else "not found"
    return f"{case.ground}: {case.before:.1f} → {after}"


def _plate_table(filled: dict[str, dict[str, Filled]]) -> str:
    rows = [[name, *(_plate_cell(found[way]) for way in WAYS)] for name, found in filled.items()]
    means = [
        [float(np.mean([getattr(filled[name][way], part) for name in HOLES]))
         for part in ("psnr", "ssim", "unlike", "hed", "seconds")]
        for way in WAYS
    ]  # fmt: skip
    told = (f"{p:.1f}, {s:.3f}, {u:.3f}, {h:.3f}; {t:.2f} s" for p, s, u, h, t in means)
    rows.append(["**mean**", *told])
    return _table(["PSNR dB, SSIM, unlike, HED", *WAYS], rows)


def _plate_cell(filled: Filled) -> str:
    return f"{filled.psnr:.1f}, {filled.ssim:.3f}, {filled.unlike:.3f}, {filled.hed:.3f}"


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
