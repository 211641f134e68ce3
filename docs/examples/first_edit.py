"""A first edit with the library, in cells: run it whole, or cell by cell in an editor.

It runs in the current folder, on a sample photo of the repository, without a learned model.
"""

# %% A photo is opened. An edit does nothing yet, and never changes: each method gives a new one.
from pathlib import Path

import numpy as np

import objectmorpher_core as om

SAMPLES = Path(__file__).parents[2] / "assets" / "samples"
photo = om.open(SAMPLES / "flower.jpg", seed=1).options(segment="grabcut")

# %% One click says which object is meant. The selection is an array of (height, width), bool.
flower = photo.click(310, 240)
mask = flower.selection
print(f"selected {mask.mean():.0%} of {mask.shape[1]} x {mask.shape[0]} px")

# %% Any array of that kind chooses an object, too: here, what of it is in the photo's left half.
left = mask & (np.arange(mask.shape[1]) < 320)
assert om.open(SAMPLES / "flower.jpg").mask(left).selection.sum() == left.sum()

# %% Lifting makes it a 3D shape, once. Every pose below starts from it.
lifted = flower.lift(gaussians=4000)

# %% The whole object turns, and moves 60 px to the right.
turned = lifted.turn(yaw=25, pitch=-8).move(60, 0).harmonise().render()
turned.save("turned.png")

# %% One point is dragged, another one stays. A quick filling behind it will do.
bent = lifted.pin(310, 330).drag((310, 150), (345, 140)).plate("telea").render()
bent.save("bent.png")
for handle in bent.report["handles"]:
    print(f"{handle['from']} -> {handle['reached']}, {handle['error_px']:.2f} px beside its target")

# %% What the edit does not touch is the photo, byte for byte.
before, after = photo.document.photo.pixels, turned.pixels
print(f"{(before == after).all(2).mean():.0%} of the pixels are the photo's")
assert np.array_equal(before[:, :60], after[:, :60])

# %% Background and object alone, layers for GIMP and Krita, a session for the window.
turned.save("background.png", "plate")
turned.save("object.png", "object")
turned.save("layers.ora", "layers")
turned.save("flower.omorph", "session")

# %% A session is the same edit again.
assert om.replay("flower.omorph").encode() == turned.encode()
