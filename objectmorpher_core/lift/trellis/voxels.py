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
        """Of a grid (R, R, R) bool."""
        return Voxels(torch.nonzero(occupied), occupied.shape[0])

    def __len__(self) -> int:
        return len(self.cells)

    @cached_property
    def neighbours(self) -> tuple[Pairs, ...]:
        """For each of the 27 OFFSETS the pairs of cells that are so far apart."""
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
        return Halved(Voxels(cells, side), parents)

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
        order = torch.argsort(code, stable=True)
        counts = torch.unique_consecutive(code[order], return_counts=True)[1]
        starts = torch.cumsum(counts, 0) - counts
        groups, least, length = [], 0, SHORTEST
        while least < int(counts.max()):
            chosen = (counts > least) & (counts <= length)
            if bool(chosen.any()):
                steps = torch.arange(length, device=device)
                is_there = steps < counts[chosen, None]
                index = torch.where(is_there, starts[chosen, None] + steps, starts[chosen, None])
                groups.append(Windows(order[index], is_there))
            least, length = length, 2 * length
        return tuple(groups)


def pooled(values: Tensor, fine: Voxels) -> Tensor:
    """(B, M, C) of the coarse cells, from (B, N, C) of those of `fine`.

    Not quite the mean: the published network was trained with a zero counted in beside the n
    cells, so the sum is divided by n + 1.
    """
    coarse, parents = fine.halved
    sums = values.new_zeros((values.shape[0], len(coarse), values.shape[2]), dtype=torch.float32)
    sums.index_add_(1, parents, values.float())
    counts = torch.bincount(parents, minlength=len(coarse)) + 1
    return (sums / counts[:, None]).to(values.dtype)
