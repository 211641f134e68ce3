"""Sparse convolution, pooling and windowed attention against dense ones."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="TRELLIS needs torch")

from torch.nn import functional

from objectmorpher_core.lift.trellis import blocks
from objectmorpher_core.lift.trellis.blocks import attend, attend_in_windows
from objectmorpher_core.lift.trellis.latent import Kernel
from objectmorpher_core.lift.trellis.voxels import Voxels, pooled

F32 = 1e-5  # sums in another order
RESOLUTION = 12


@pytest.fixture(scope="module", params=[0.02, 0.3, 1.0], ids=["few", "some", "all"])
def voxels(request):
    torch.manual_seed(0)
    occupied = torch.rand([RESOLUTION] * 3) < request.param
    occupied[0, 0, 0] = occupied[-1, -1, -1] = True  # at the grid's border
    return Voxels.of(occupied)


def dense(values, voxels):
    """(C, R, R, R), 0 where nothing is."""
    grid = values.new_zeros((values.shape[1], *[voxels.resolution] * 3))
    grid[:, *voxels.cells.T] = values.T
    return grid


def test_a_sparse_convolution_is_a_dense_one_looked_at_in_the_occupied_cells(voxels):
    torch.manual_seed(1)
    kernel, values = Kernel(5, 7), torch.randn(2, len(voxels), 5)
    torch.nn.init.normal_(kernel.bias)
    found = kernel(values, voxels)
    weight = kernel.weight.permute(0, 4, 1, 2, 3)
    for item, own in zip(values, found, strict=True):
        whole = functional.conv3d(dense(item, voxels)[None], weight, kernel.bias, padding=1)[0]
        assert torch.allclose(own, whole[:, *voxels.cells.T].T, atol=F32)


def test_neighbours_are_mutual(voxels):
    for one, other in zip(voxels.neighbours, reversed(voxels.neighbours), strict=True):
        assert set(zip(*map(torch.Tensor.tolist, one), strict=True)) == set(
            zip(*map(torch.Tensor.tolist, reversed(other)), strict=True)
        )


def test_pooling_counts_a_zero_in_as_the_published_network_does(voxels):
    values = torch.randn(1, len(voxels), 3)
    found, coarse = pooled(values, voxels), voxels.halved.voxels
    share = dense(torch.ones(len(voxels), 1), voxels)
    sums = 8 * functional.avg_pool3d(dense(values[0], voxels)[None], 2)[0]
    counts = 8 * functional.avg_pool3d(share[None], 2)[0]
    expected = (sums / (counts + 1))[:, *coarse.cells.T].T
    assert torch.allclose(found[0], expected, atol=F32)
    assert int((counts > 0).sum()) == len(coarse)


@pytest.mark.parametrize("shift", [0, 2])
def test_windowed_attention_is_masked_attention(voxels, shift):
    torch.manual_seed(2)
    size = 4
    q, k, v = torch.randn(3, 2, len(voxels), 2, 6)
    found = attend_in_windows(q, k, v, voxels.windows(size, shift))
    window = (voxels.cells + shift) // size
    same = (window[:, None] == window[None]).all(2)
    q, k, v = (t.transpose(1, 2) for t in (q, k, v))
    whole = functional.scaled_dot_product_attention(q, k, v, attn_mask=same)
    assert torch.allclose(found, whole.transpose(1, 2), atol=F32)


def test_each_cell_is_in_one_window(voxels):
    cells = [g.members[g.is_there] for g in voxels.windows(4, 2)]
    assert sorted(torch.cat(cells).tolist()) == list(range(len(voxels)))


def test_attention_in_portions_is_attention(monkeypatch):
    torch.manual_seed(3)
    q, k, v = torch.randn(3, 2, 37, 4, 8)
    is_key = torch.rand(2, 37) < 0.5
    whole = attend(q, k, v), attend(q, k, v, is_key)
    monkeypatch.setattr(blocks, "SCORES", 2 * 4 * 37 * 5)  # five queries at a time
    for found, expected in zip((attend(q, k, v), attend(q, k, v, is_key)), whole, strict=True):
        assert torch.allclose(found, expected, atol=F32)


def test_half_precision_keeps_its_type_and_comes_near(voxels):
    torch.manual_seed(4)
    kernel, values = Kernel(5, 7), torch.randn(1, len(voxels), 5)
    near = kernel(values, voxels)
    low = kernel.to(torch.bfloat16)(values.bfloat16(), voxels)
    assert low.dtype == torch.bfloat16
    assert (low.float() - near).abs().max() < 0.03 * near.abs().max()  # eight bits
