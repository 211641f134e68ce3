"""The occupied cells of a cubic grid, and how they lie beside one another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import torch
from torch import Tensor

SHORTEST = 8  # cells of a window that is attended to at once: shorter ones are filled up
OFFSETS = tuple(product((-1, 0, 1), repeat=3))  # of a 3 x 3 x 3 kernel, the last axis fastest


class Pairs(NamedTuple):
    """Cells whose neighbour in one direction is occupied."""

    rows: Tensor  # (P,) index of the cell
    columns: Tensor  # (P,) index of the neighbour


class Halved(NamedTuple):
    """A grid of half the resolution."""

    voxels: Voxels
    parents: Tensor  # (N,) index of the coarse cell that each cell lies in
    children: Tensor  # (M, 8) index of the cells in each coarse cell; rows are filled up with any
    is_there: Tensor  # (M, 8) bool: not merely filled up


class Windows(NamedTuple):
    """Windows that hold about as many cells."""

    members: Tensor  # (W, L) index of cells; rows are filled up with any
    is_there: Tensor  # (W, L) bool: not merely filled up


@dataclass(frozen=True, eq=False)
class Voxels:
    """N cells, each once, in the grid's order."""

    cells: Tensor  # (N, 3) int64 in [0, resolution)
    resolution: int

    @staticmethod
    def of(occupied: Tensor) -> Voxels:
        """Return the occupied cells of a grid (R, R, R) bool."""
        return Voxels(torch.nonzero(occupied), occupied.shape[0])

    def __len__(self) -> int:
        return len(self.cells)

    @cached_property
    def neighbours(self) -> tuple[Pairs, ...]:
        """Return, for each of the 27 OFFSETS, the pairs of cells that lie so far apart."""
        side, device = self.resolution + 2, self.cells.device  # a border, so that none is outside
        strides = torch.tensor([side * side, side, 1], device=device)
        code = ((self.cells + 1) * strides).sum(1)
        number = torch.full((side**3,), -1, dtype=torch.int64, device=device)
        number[code] = torch.arange(len(self), device=device)
        found = []
        for x, y, z in OFFSETS:
            there = number[code + (x * side + y) * side + z]
            rows = torch.nonzero(there >= 0)[:, 0]
            found.append(Pairs(rows, there[rows]))
        return tuple(found)

    @cached_property
    def halved(self) -> Halved:
        """Cells twice as wide that hold at least one of these."""
        side = (self.resolution + 1) // 2
        strides = torch.tensor([side * side, side, 1], device=self.cells.device)
        code, parents = torch.unique(((self.cells // 2) * strides).sum(1), return_inverse=True)
        cells = torch.stack([code // (side * side), code // side % side, code % side], 1)
        children, is_there = _members(parents, torch.bincount(parents), 8)
        return Halved(Voxels(cells, side), parents, children, is_there)

    @cached_property
    def _windows(self) -> dict[tuple[int, int], tuple[Windows, ...]]:
        return {}

    def windows(self, size: int, shift: int) -> tuple[Windows, ...]:
        """The cells in cubes of `size` cells, the cubes' corners at -`shift`."""
        if (size, shift) not in self._windows:
            self._windows[size, shift] = self._partitioned(size, shift)
        return self._windows[size, shift]

    def _partitioned(self, size: int, shift: int) -> tuple[Windows, ...]:
        side, device = (self.resolution + shift) // size + 1, self.cells.device
        strides = torch.tensor([side * side, side, 1], device=device)
        code = ((self.cells + shift) // size * strides).sum(1)
        _, window, counts = torch.unique(code, return_inverse=True, return_counts=True)
        groups, least, length = [], 0, SHORTEST
        while least < int(counts.max()):
            chosen = (counts > least) & (counts <= length)
            if bool(chosen.any()):
                members, is_there = _members(window, counts, length)
                groups.append(Windows(members[chosen], is_there[chosen]))
            least, length = length, 2 * length
        return tuple(groups)


def _members(groups: Tensor, counts: Tensor, length: int) -> tuple[Tensor, Tensor]:
    """Index (G, length) of what is in each group, filled up with any, and what is not (bool).

    `groups` (N,) the group of each, `counts` (G,) how many each has: where that is more, some.
    """
    order = torch.argsort(groups, stable=True)
    starts = (torch.cumsum(counts, 0) - counts)[:, None]
    steps = torch.arange(length, device=groups.device)
    is_there = steps < counts[:, None]
    return order[torch.where(is_there, starts + steps, starts)], is_there


def pooled(values: Tensor, fine: Voxels) -> Tensor:
    """(B, M, C) of the coarse cells, from (B, N, C) of those of `fine`.

    Not quite the mean: the published network was trained with a zero counted in beside the n
    cells, so the sum is divided by n + 1.
    """
    halved = fine.halved
    # Gathered, not scattered: a GPU would add in another order each time.
    cells = values[:, halved.children].float() * halved.is_there[:, :, None]
    sums, counts = cells.sum(2), halved.is_there.sum(1) + 1
    return (sums / counts[:, None]).to(values.dtype)
