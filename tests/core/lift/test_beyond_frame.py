"""What goes on beyond the photo's frame: nearer to what is there than a mirror image is."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.lift.beyond_frame import cut_out_beyond, with_beyond
from objectmorpher_core.segment.matting.matte import cut_out
from tests.photos import outlined, photo

KEPT = 0.7  # of the object's length, where the photo is cut


def _upright(picture: np.ndarray, turns: int) -> np.ndarray:
    return np.ascontiguousarray(np.rot90(picture, turns))


@pytest.mark.parametrize("name", ["flower", "coffee"])
def test_colours_are_nearer_to_what_was_cut_off_than_a_mirror_image(name: str) -> None:
    whole, mask = photo(name), outlined({"flower": "dahlia"}.get(name, name))
    errors = []
    for turns in range(4):  # the photo's four sides
        pixels, inside = _upright(whole, turns), _upright(mask, turns)
        columns = np.flatnonzero(inside.any(0))
        cut = int(columns[0] + KEPT * np.ptp(columns))
        mirrored = cut_out(pixels[:, :cut], inside[:, :cut])
        made = with_beyond(mirrored, (cut, len(pixels)))
        assert np.array_equal(made.alpha, mirrored.alpha)
        first = cut - mirrored.left
        assert np.array_equal(made.foreground[:, :first], mirrored.foreground[:, :first])
        _, y0, x1, y1 = mirrored.box
        truth, there = pixels[y0:y1, cut:x1] / 255, inside[y0:y1, cut:x1]
        own = there & (mirrored.alpha[:, first : first + there.shape[1]] > 0.5)
        errors.append([
            np.sqrt(((matte.foreground[:, first:][:, : there.shape[1]] - truth)[own] ** 2).mean())
            for matte in (made, mirrored)
        ])  # fmt: skip
    assert own.sum() > 1000
    ours, theirs = np.array(errors).T
    assert ours.mean() < 0.93 * theirs.mean(), errors


def test_what_the_photo_shows_whole_is_left_alone() -> None:
    pixels, mask = photo("flower"), outlined("dahlia")
    matte = cut_out(pixels, mask)
    assert with_beyond(matte, (mask.shape[1], mask.shape[0])) is matte


def test_thin_things_and_whole_photos_go_on_somehow() -> None:
    pixels = photo("coffee")[:90, :120]
    masks = [np.zeros((90, 120), bool) for _ in range(4)]
    masks[0][:, 60] = True
    masks[1][:] = True
    masks[2][::2, ::2] = True
    masks[3][40, 119] = True
    for mask in masks:
        matte = cut_out_beyond(pixels, mask)
        assert np.isfinite(matte.foreground).all()
        assert matte.foreground.min() >= 0
        assert matte.foreground.max() <= 1
        again = cut_out_beyond(pixels, mask)
        assert np.array_equal(matte.foreground, again.foreground)
