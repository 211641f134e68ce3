"""Several objects in one photo: who covers whom, and what copies leave behind."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.order import back_to_front, leaves_a_hole, reordered, stack
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement, show_the_same
from objectmorpher_core.document.paint import SIDE, Paint, PaintTile
from objectmorpher_core.raster.posed import PosedSplats
from tests import shapes

WIDTH, HEIGHT = 320, 120
LEFT, RIGHT = 60.0, 260.0  # px, the discs' middles
RADIUS = 26.0
ACROSS = 180.0  # px, a move that takes one disc over half of the other
HORIZON, EYE = 20.0, 90.0  # px: a ground as it is seen, below it at a distance of 1
ROUNDING = 2  # of 255: a soft edge mixed anew


@cache
def _two_discs() -> Document:
    """Two discs side by side before a wall, both lifted; object 0 is the left one."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    discs = [np.hypot(x - middle, y - 60) < RADIUS for middle in (LEFT, RIGHT)]
    pixels = shapes.picture(discs[0] | discs[1])
    pixels[discs[1]] = pixels[discs[1]][:, ::-1]  # another colour
    scenes = [shapes.lifted_scene(pixels, disc, 700) for disc in discs]
    first, second = (scene.document() for scene in scenes)
    both = replace(first, objects=(first.objects[0], replace(second.objects[0], name="Right")))
    return replace(both, plate=shapes.grey_plate(discs[0] | discs[1]))


def _posed(document: Document, k: int) -> PosedSplats:
    item = document.objects[k]
    return puppet_of(item, document.photo.camera).posed(item.pose, item.placement)


def _moved(document: Document, k: int, placement: Placement) -> Document:
    return edits.set_placement(document, k, placement)


def _order(document: Document) -> list[int]:
    return list(stack(document, lambda k: _posed(document, k)))


def test_an_object_at_rest_covers_what_moves_behind_it():
    document = _two_discs()
    away = _moved(document, 0, Placement(move=(ACROSS, 0.0), depth=1.0))
    result = composite(away)
    photo = document.photo.pixels
    right = document.objects[1].matte
    assert right is not None
    x0, y0, x1, y1 = right.box
    is_opaque = right.alpha >= 1
    own = result.pixels[y0:y1, x0:x1][is_opaque]
    assert np.array_equal(own, photo[y0:y1, x0:x1][is_opaque]), "its own bytes"
    at = (60, int(RIGHT - RADIUS - 3))
    assert np.abs(result.pixels[at].astype(int) - photo[at]).max() > 30, (
        "what moved is seen beside it"
    )
    assert result.outside_footprint_changed == 0


@pytest.mark.parametrize("is_painted", [False, True])
def test_behind_the_edge_of_an_object_at_rest_all_shares_sum_to_one(is_painted: bool):
    document = _two_discs()
    left, lifted = document.objects[0], document.objects[0].lifted
    assert left.matte is not None and lifted is not None
    green = PaintTile(0, 0, np.full((SIDE, SIDE, 4), (0, 255, 0, 255)))
    paint = Paint((green,), np.zeros((len(lifted.gaussians), 4), np.uint8)) if is_painted else None
    painted = replace(left, matte=replace(left.matte, paint=paint))
    document = replace(document, objects=(painted, document.objects[1]))
    result = composite(_moved(document, 0, Placement(move=(ACROSS, 0.0), depth=1.0)))
    assert [thing.item.is_moved for thing in result.stack] == [True, False]
    shares = vars(result.shares)
    assert sum(shares.values()) == pytest.approx(1, abs=1e-6)
    assert min(shares.values()) >= 0 and (shares["from_paint"] > 0.1) == is_painted


def test_what_moves_in_front_of_an_object_at_rest_covers_it():
    document = _two_discs()
    near = _moved(document, 0, Placement(move=(ACROSS, 0.0), depth=-0.5))
    pixels = composite(near).pixels
    middle = document.photo.pixels[60, int(RIGHT)].astype(int)
    assert np.abs(pixels[60, int(RIGHT)] - middle).max() > 30


def test_a_layer_in_front_wins_over_the_depth():
    document = _two_discs()
    near = _moved(document, 0, Placement(move=(ACROSS, 0.0), depth=-0.5))
    assert _order(near) == [1, 0]
    raised = replace(near, objects=(near.objects[0], replace(near.objects[1], layer=1)))
    assert _order(raised) == [0, 1]
    photo, at = document.photo.pixels, (60, int(RIGHT))
    assert np.array_equal(composite(raised).pixels[at], photo[at])


def test_an_object_at_rest_far_from_what_moves_is_not_drawn():
    document = _two_discs()
    assert _order(_moved(document, 0, Placement(move=(-8.0, 0.0)))) == [0]
    assert _order(_moved(document, 0, Placement(move=(ACROSS, 0.0)))) in ([0, 1], [1, 0])
    assert _order(document) == []


def test_what_is_blurred_reaches_as_far_as_its_blur():
    document = _moved(_two_discs(), 0, Placement(move=(60.0, 0.0)))
    assert _order(document) == [0]
    item = document.objects[0]
    blurred = replace(item, finish=replace(item.finish, blur=30.0))
    assert len(_order(replace(document, objects=(blurred, document.objects[1])))) == 2


def test_the_edge_of_an_object_at_rest_is_kept_beside_a_hole():
    """The plate is without both objects: beside the hole it would show through the edge."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    halves = [(np.hypot(x - 100, y - 60) < 40) & side for side in (x < 100, x >= 100)]
    pixels = shapes.picture(halves[0] | halves[1])
    first, second = (shapes.lifted_scene(pixels, half, 700).document() for half in halves)
    document = replace(first, objects=(*first.objects, *second.objects))
    document = replace(document, plate=shapes.grey_plate(halves[0] | halves[1]))
    hidden = composite(edits.set_visible(document, 0, False)).pixels
    assert np.array_equal(hidden[40:80, 104:130], pixels[40:80, 104:130])
    assert np.array_equal(hidden[60, 80], [128, 128, 128])


def test_a_copy_moved_aside_is_in_front_of_what_it_is_a_copy_of_and_moved_up_behind():
    document = edits.duplicate(_two_discs(), 0)
    for move in ((20.0, 0.0), (-13.7, 5.1)):
        assert _order(_moved(document, 2, Placement(move=move)))[-1] == 2
    assert _order(_moved(document, 2, Placement(move=(3.3, -9.9))))[-1] == 0


def test_of_two_things_on_one_ground_the_nearer_is_in_front_whatever_their_lifts_say():
    """Of any size, anywhere on it: the depth that a placement says beside them is a convention."""
    rng, document = np.random.default_rng(5), _two_discs()
    assert document.objects[0].lifted is not None
    unit = document.objects[0].lifted.diameter * document.objects[0].lifted.scale
    depth = document.objects[0].lifted.centre[2]
    seen = 0
    for _ in range(60):
        away, size = rng.uniform(1, 4, 2), rng.uniform(0.3, 3, 2)
        if abs(1 / away[0] - 1 / away[1]) * EYE < 0.06 * RADIUS * (size / away).max():
            continue  # as far as a foot is told from a control point
        for k, middle in enumerate((LEFT, RIGHT)):
            to = np.array([rng.uniform(0, WIDTH), HORIZON + (EYE - RADIUS * size[k]) / away[k]])
            further = rng.uniform(-0.5, 2.0)
            scale = size[k] / away[k] * (1 + further * unit / depth)
            move = float(to[0] - middle), float(to[1] - HEIGHT / 2)
            place = Placement(move=move, depth=float(further), scale=float(scale))
            document = _moved(document, k, place)
        order, far = _order(document), int(away[1] > away[0])
        assert order == [far, 1 - far], (away, size)
        seen += 1
    assert seen > 40


def test_a_copy_dragged_past_another_changes_places_with_it_once():
    document = _moved(edits.duplicate(_two_discs(), 0), 2, Placement(scale=0.5))
    orders = [
        tuple(_order(_moved(document, 2, Placement((0.2 * step, float(step)), scale=0.5))))
        for step in range(-8, 40, 2)
    ]
    assert (orders[0], orders[-1]) == ((2, 0), (0, 2))
    assert sum(a != b for a, b in pairwise(orders)) == 1


def test_what_stands_on_a_plate_is_in_front_of_it_and_what_stands_beyond_it_behind():
    document = _two_discs()
    thing, up = document.objects[0], np.array([0.0, -0.6, -0.8])
    assert thing.lifted is not None
    nodes = thing.lifted.control_points.astype(np.float64)
    flat = nodes - 0.9 * np.outer((nodes - nodes.mean(0)) @ up, up)
    plate = replace(thing.lifted, control_points=flat, up=tuple(up))
    document = document.with_object(0, replace(thing, lifted=plate))
    document = _moved(document, 0, Placement(scale=1.001))  # it was touched
    rows = document.photo.camera.project(plate.world_points(flat))[:, 1]
    small = 0.3
    for foot in np.linspace(rows.min() - 12, rows.max() + 12, 9):
        down = float(foot - small * RADIUS - HEIGHT / 2)
        move = Placement(move=(LEFT - RIGHT, down), scale=small)
        order = _order(_moved(document, 1, move))
        if abs(foot - rows.min()) > 2:  # as far as a foot is told from a control point
            assert order == ([0, 1] if foot > rows.min() else [1, 0]), (foot, rows.min())


def test_what_floats_as_the_artist_says_is_in_front_by_its_depth():
    document = _two_discs()
    float_up = replace(document.objects[0].shape, is_standing=False)
    objects = tuple(replace(item, shape=float_up) for item in document.objects)
    for depth, order in ((-0.1, [1, 0]), (0.1, [0, 1])):
        for up in (-20.0, 20.0):
            place = Placement(move=(ACROSS, up), depth=depth)
            assert _order(_moved(replace(document, objects=objects), 0, place)) == order
            first = replace(document, objects=(objects[0], document.objects[1]))
            assert _order(_moved(first, 0, place)) == order, "also where the other one stands"


# ---- putting in order -----------------------------------------------------------------------


@pytest.mark.parametrize("order", [[1, 0, 2], [2, 1, 0], [0, 2, 1], [0, 1, 2], [1, 2, 0]])
def test_any_order_can_be_had_whatever_the_depths(order: list[int]):
    document = edits.duplicate(_two_discs(), 0)
    for k, depth in enumerate((0.3, 0.0, -0.3)):
        document = _moved(document, k, Placement(depth=depth))
    posed = {k: _posed(document, k) for k in range(3)}
    for k in range(3):
        changed = reordered(document, k, order, posed.__getitem__)
        assert back_to_front(changed, posed) == order


def test_putting_back_the_order_of_depth_needs_no_layers():
    document = _two_discs()
    document = _moved(document, 0, Placement(depth=0.5))
    posed = {k: _posed(document, k) for k in range(2)}
    front = reordered(document, 0, [1, 0], posed.__getitem__)
    assert [o.layer for o in front.objects] == [1, 0]
    back = reordered(front, 0, [0, 1], posed.__getitem__)
    assert [o.layer for o in back.objects] == [0, 0]


# ---- copies ---------------------------------------------------------------------------------


def test_a_copy_at_rest_changes_nothing():
    document = edits.duplicate(_two_discs(), 0)
    assert [o.name for o in document.objects] == ["Object 1", "Right", "Object 1 copy"]
    assert document.objects[2].lifted is document.objects[0].lifted
    assert document.plate is _two_discs().plate
    assert np.array_equal(composite(document).pixels, document.photo.pixels)


@pytest.mark.parametrize("k", [0, 2], ids=["the object", "its copy"])
@pytest.mark.parametrize("is_shown", [True, False], ids=["moved", "hidden"])
def test_of_a_copied_object_one_stays_and_there_is_no_hole(k: int, is_shown: bool):
    document = edits.duplicate(_two_discs(), 0)
    photo, mask = document.photo.pixels, document.objects[0].mask
    assert mask is not None
    if is_shown:
        changed = _moved(document, k, Placement(move=(0.0, -70.0)))  # above where it was
    else:
        changed = edits.set_visible(document, k, False)
    assert not leaves_a_hole(changed.objects, k)
    result = composite(changed)
    below = slice(50, HEIGHT)
    assert np.array_equal(result.pixels[below], photo[below]), "and nothing around it"
    assert (result.changed > 0) == is_shown
    assert result.shares.from_inpainter < 0.05


def test_a_copy_moved_by_a_little_lies_over_the_object():
    document = edits.duplicate(_two_discs(), 0)
    result = composite(_moved(document, 2, Placement(move=(20.0, 0.0), depth=-0.3)))
    photo = document.photo.pixels
    left = (slice(36, 84), slice(0, int(LEFT - 12)))  # what the copy does not reach
    assert np.abs(result.pixels[left].astype(int) - photo[left]).max() <= ROUNDING
    assert not (result.pixels == 128).all(-1).any(), "no plate is seen"


def test_where_the_object_and_its_copy_both_left_the_hole_shows():
    document = edits.duplicate(_two_discs(), 0)
    for k, up in ((0, -90.0), (2, 90.0)):
        document = _moved(document, k, Placement(move=(0.0, up)))
    assert leaves_a_hole(document.objects, 0) and leaves_a_hole(document.objects, 2)
    pixels = composite(document).pixels
    assert np.array_equal(pixels[60, int(LEFT)], [128, 128, 128])


def test_removing_an_object_takes_the_plate_unless_a_copy_stays():
    document = edits.duplicate(_two_discs(), 0)
    one = edits.remove_object(document, 0)
    assert one.plate is document.plate
    assert [o.name for o in one.objects] == ["Right", "Object 1 copy"]
    assert edits.remove_object(one, 1).plate is None


def test_names_can_be_changed_but_not_be_empty():
    document = edits.rename(_two_discs(), 0, "  Cat 3 ")
    assert document.objects[0].name == "Cat 3"
    assert document.plate is not None
    assert edits.duplicate(document, 0).objects[2].name == "Cat 3 copy"
    with pytest.raises(edits.EditError, match="name"):
        edits.rename(document, 0, " ")


def test_what_looks_the_same_is_drawn_in_the_same_order():
    """So a refinement of the edit does not stay when what is put on the ground changes it."""
    away = _moved(_two_discs(), 0, Placement(move=(ACROSS, 20.0), depth=1.3))
    floating = replace(away.objects[0], shape=replace(away.objects[0].shape, is_standing=False))
    one = away.with_object(0, floating)
    other = edits.set_grounded(one, 0, True)
    assert _order(one) != _order(other)
    assert not show_the_same(one, other)
    assert show_the_same(away, edits.set_grounded(away, 0, True))
