"""Votes: pieces decided anew by nearby pieces of like colour and kind.

An answer is right in most of its pieces. Each piece is told by the others how likely it is in the
object, those counting most that are like it in colour (CIELAB), token and place: a joint bilateral
filter of labels over pieces (Tomasi & Manduchi 1998; Petschnig et al. 2004). A random walker with
these odds as prior (Grady 2005) then decides, so that a piece no other is like goes with its
neighbours.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components

from ...base.arrays import F32, F64, Mask
from .pieces import Pieces

LIKE_COLOR = 5.0  # CIELAB units, standard deviation of how far a colour counts
LIKE_KIND = 0.3  # of 1 - cosine between tokens, the same as an exponential
NEAR = 0.6  # x square root of the object's area, standard deviation of how far a place counts
DOUBT_COLOR = 10.0  # CIELAB units, the same for what a click contradicts
VOTERS = 500  # of the object, and of the rest: more change nothing visible
LEAST_ODDS = 0.02  # a vote is never surer than that
KEEPS = 0.8  # x contrast of the answer before: a vote that blurs it is not heard
TRUST = 0.02  # of the votes, x a walk's ease between like neighbours


def relabel(
    pieces: Pieces,
    mask: Mask,
    wanted: tuple[int, ...],
    unwanted: tuple[int, ...] = (),
    doubted: int | None = None,
) -> Mask:
    """(n,) the pieces in `mask` (n,) after the vote; `wanted` and `unwanted` pieces are known.

    `mask` as it is, where what the vote makes of it stands out less.
    """
    if not mask.any() or mask.all():
        return mask
    chance = votes(pieces, mask, doubted)
    odds = TRUST * np.log(chance / (1 - chance))
    is_object, is_ground = np.maximum(odds, 0) + 1e-9, np.maximum(-odds, 0) + 1e-9
    is_object[list(wanted)] = is_ground[list(unwanted)] = 1e4
    found = pieces.walk_home(is_object, is_ground) > 0.5
    stands_out = not found.all() and pieces.contrast(found) >= KEEPS * pieces.contrast(mask)
    return found if stands_out else mask


def votes(pieces: Pieces, mask: Mask, doubted: int | None = None) -> F64:
    """(n,) how likely a piece is in the object by the labels `mask` (n,) of the others like it.

    Of those on its side, what is like the piece `doubted` is not heard.
    """
    heard = _heard(pieces, mask, doubted)
    size = float(np.sqrt(pieces.area[mask].sum()))
    places = _places(pieces, NEAR * size)
    squares = np.square(places).sum(1)
    total = 1e-6 * heard + 1e-9  # what no other is like stays what it is, unless it is doubted
    inside = 1e-6 * heard * mask + 0.5e-9
    for label in (True, False):
        voters = np.flatnonzero(mask == label)
        step = max(1, -(-len(voters) // VOTERS))
        voters = voters[::step]
        weight = 2 * places @ places[voters].T  # less the squares of both: - the squared distance
        weight -= squares[:, None]
        weight -= squares[voters]
        np.exp(np.minimum(weight, 0, out=weight), out=weight)
        weight *= (step * (heard * pieces.area)[voters]).astype(np.float32)
        weight[voters, np.arange(len(voters))] = 0  # none votes for itself
        total += weight.sum(1)
        inside += label * weight.sum(1)
    return np.clip(inside / total, LEAST_ODDS, 1 - LEAST_ODDS)


def _heard(pieces: Pieces, mask: Mask, doubted: int | None) -> F64:
    """(n,) how much each piece's vote counts: what is like one that was set apart says little."""
    heard = np.ones(pieces.count)
    if doubted is not None:
        color = np.square(pieces.colors - pieces.colors[doubted]).sum(1) / DOUBT_COLOR**2
        kind = np.square(pieces.features - pieces.features[doubted]).sum(1) / LIKE_KIND
        contrary = mask != mask[doubted]
        heard[contrary] -= np.exp(-0.5 * (color + kind))[contrary]
    return heard


def _places(pieces: Pieces, near: float) -> F32:
    """(n, d) where pieces are in a space in which the squared distance of two is their unlikeness.

    `near`: px that count as much as LIKE_COLOR does.
    """
    parts = [pieces.centres / near, pieces.colors / LIKE_COLOR, pieces.features / LIKE_KIND**0.5]
    return (np.concatenate(parts, 1) / 2**0.5).astype(np.float32)


def touching(pieces: Pieces, mask: Mask, start: Mask) -> Mask:
    """(n,) the connected sets of pieces in `mask` (n,) that hold one of `start` (n,)."""
    return pieces.reached(mask, start)


def islands(pieces: Pieces, mask: Mask) -> list[Mask]:
    """The connected sets (n,) of pieces in a mask (n,)."""
    linked = mask[pieces.left] & mask[pieces.right]
    ends = (pieces.left[linked], pieces.right[linked])
    graph = sparse.coo_array((np.ones(int(linked.sum())), ends), (pieces.count, pieces.count))
    _, labels = connected_components(graph, directed=False)
    return [(labels == k) & mask for k in np.unique(labels[mask])]
