"""Writes the table of docs/model-measurements.md between its two marks: what each network takes.

`python docs/estimates/make_estimates.py` needs the extra `models`, no weights and no GPU, and a
minute. Parameters and operations are counted on networks of the published sizes; memory is what the
program itself plans with; seconds are operations by a third of what a device can do at most.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import torch
import transformers
from published import (
    KEYS,
    LORA,
    SAM,
    SAM2,
    build,
    lora_parameters,
    normal,
    operations,
    parameters,
    trellis_parts,
)

from objectmorpher_core import models
from objectmorpher_core.compose.plate import inpaint_latent, latent_diffusion
from objectmorpher_core.compose.refine import klein, qwen
from objectmorpher_core.compose.refine.diffusion import DiffusionRefiner
from objectmorpher_core.lift.trellis import lifter
from objectmorpher_core.lift.trellis.lifter import FEWEST, TripoSplatLifter
from objectmorpher_core.lift.triposplat import generator, networks
from objectmorpher_core.models import depth_net
from objectmorpher_core.models.plans import RESIDENT, Need, Network, PipelineNeed, Way
from objectmorpher_core.segment.sam import sam_torch

PAGE = Path(__file__).parents[1] / "model-measurements.md"
START, END = "<!-- estimates -->\n", "<!-- end of estimates -->\n"
GPU, CPU = 80e12, 50e9  # operations a second: a GPU of 2023 at half precision; two processor cores
SHARE = 1 / 3  # of that which a network gets; the CPU's number is what it gets
FORWARDS = 22  # of each of TRELLIS's flows: 12 steps, 10 of them with guidance
LATENT = 3.3e12 * FORWARDS + 2.0e12  # operations on 11,008 cells, as docs/trellis.md tells
DECODER = "slat_dec_gs_swin8_B_64l8gs32_fp16"  # TRELLIS's, which CUPID uses
WORDS = 1000  # tokens of the instruction and the two pictures, as Qwen-Image-Edit reads them
CROP = 3 * 4096  # tokens of 1024 x 1024 px: the picture in the making, the photo, the edit
HEAD = (
    "backend, tier", "parameters", "float32", "half", "four bits", "peak memory", "operations",
    "seconds, GPU", "seconds, CPU",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """A backend in one of the ways in which it can run."""

    name: str
    parameters: int  # of all its networks
    memory: int  # bytes at most
    operations: float
    has_gpu: bool = True
    has_cpu: bool = True
    is_exact: bool = True  # whether the parameters were counted

    def cells(self) -> tuple[str, ...]:
        """Of the table's line."""
        count = f"{self.parameters / 1e6:,.0f} M" if self.parameters >= 1e6 else "–"
        weights = [_bytes(self.parameters * size) for size in (4, 2, 0.64)]
        tera = self.operations / 1e12
        work = "–" if not tera else f"{tera:,.0f} T" if tera >= 100 else f"{tera:.2g} T"
        gpu, cpu = self.operations / (GPU * SHARE), self.operations / CPU
        return (
            self.name, count if self.is_exact else f"about {count}", *weights, _bytes(self.memory),
            work, _seconds(gpu) if self.has_gpu else "–", _seconds(cpu) if self.has_cpu else "–",
        )  # fmt: skip


def rows() -> Iterator[Row]:
    """Stage by stage."""
    yield from _segmenters()
    yield from _lifters()
    yield from _inpainters()
    yield from _refiners()


def table() -> str:
    """In Markdown."""
    lines = [HEAD, ("---", *["---:"] * (len(HEAD) - 1)), *(row.cells() for row in rows())]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def in_page(page: str) -> str:
    """The table that a page holds. Raises ValueError where it has not its marks."""
    return page[slice(*_marks(page))]


def _marks(page: str) -> tuple[int, int]:
    start = page.index(START) + len(START)
    return start, page.index(END, start)


def _segmenters() -> Iterator[Row]:
    for name in (*SAM2, "sam3", *SAM):
        family = models.hub_model(name).family
        side = 1008 if family == "sam3" else 1024
        work = operations(build(name), lambda m, side=side: m.get_image_embeddings(_photo(side)))
        need = Need(models.hub_model(name).parameters * 1_000_000, sam_torch.WORK[family])
        yield Row(f"`{name}`, a photo; GPU", _count(name), need.bytes("float16"), work)
        yield Row("CPU", _count(name), need.bytes("float32"), work, has_gpu=False)
    for name in ("mobile-sam", "efficient-sam"):
        yield _of_file(name, models.hub_model(name).size)
    for weight in models.weights():
        if weight.category != "evaluation":
            yield _of_file(weight.id, weight.size)


def _lifters() -> Iterator[Row]:
    seen = operations(build("dino"), lambda m: m(_photo(518)))
    for name, channels, others in (("trellis", 8, ()), ("cupid", 16, (DECODER,))):
        parts = (*trellis_parts(name), *others)
        flow = next(part for part in parts if part.startswith(("ss_flow", "suv_flow")))
        given = normal(1, channels, 16, 16, 16), normal(1), normal(1, 1374, 1024)
        step = operations(build(flow), lambda m, given=given: m(*given))
        count = _count("dino") + sum(map(_count, parts))
        need, work = lifter.TrellisLifter().need(), FORWARDS * step + LATENT + seen
        yield from _lifter(name, count, need, work)
    yield from _lifter("triposplat", *_triposplat())
    count, work = _count("depth"), operations(build("depth"), lambda m: m(_photo(518)))
    need = Need(count, depth_net.WORK)
    name = "`depth-anything-v2-small`, for the relief"
    yield Row(f"{name}; GPU or CPU", count, need.bytes("float32"), work)


def _lifter(name: str, count: int, need: Need, work: float) -> Iterator[Row]:
    for tier, memory in (
        (f"`{name}`, an object; GPU, whole", need.bytes("float16")),
        ("GPU, a part at a time", need.bytes("float16", RESIDENT)),
    ):
        yield Row(tier, count, memory, work, has_cpu=False)
    yield Row("CPU", count, need.bytes("float32", RESIDENT), work, has_gpu=False)


def _triposplat() -> tuple[int, Need, float]:
    """Numbers in all, what they need, and the operations for as few Gaussians as can be."""
    form, names = networks.FORM, ("dino3", "klein-vae", "triposplat-flow", "triposplat-decoder")
    seen, drawn, flow, decoder = (build(name) for name in names)
    points = FEWEST // form.per_point
    latents, told = normal(1, form.tokens, form.channels), normal(1, 4101, form.seen + form.drawn)
    packed = normal(1, form.tokens + 1, form.channels)
    # Two forwards a step, with and without the picture; a level of the octree has eight times the
    # cells of the one before, until each point has its own.
    work = 2 * generator.SAMPLING.steps * operations(flow, lambda m: m(packed, normal(1), told))
    work += operations(seen, lambda m: m(pixel_values=_photo(1024)))
    work += operations(drawn, lambda m: m.encode(_photo(1024)))
    work += operations(decoder, lambda m: m.gs(normal(1, points, 3), latents))
    for level in range(networks.LEVELS):
        cells = normal(1, min(8**level, points), 3)
        work += operations(decoder, lambda m, cells=cells: m.octree(cells, 2, latents))
    return sum(_count(name) for name in names), TripoSplatLifter().need(), work


def _inpainters() -> Iterator[Row]:
    codec = build("pixelhacker-vae")
    ids = torch.zeros(2, 10, dtype=torch.long, device="meta")
    drawn = operations(codec, lambda m: (m.encode(_photo(512)), m.decode(normal(1, 4, 64, 64))))
    for name in ("pixelhacker", "moebius"):
        unet = build(name)
        step = operations(unet, lambda m: m(normal(2, 9, 64, 64), normal(2), ids))
        work = (latent_diffusion.STEPS - 1) * step + drawn
        count = parameters(unet) + parameters(codec)
        need = inpaint_latent.need(count)
        yield Row(f"`{name}`, a square; float32", count, need.bytes("float32"), work)
        yield Row("GPU, bfloat16", count, need.bytes("bfloat16"), work, has_cpu=False)
    for name in ("lama", "migan"):
        yield _of_file(name, models.hub_model(name).size)


def _refiners() -> Iterator[Row]:
    network = build("qwen")
    step = operations(network, lambda m: m(
        hidden_states=normal(1, CROP, 64), timestep=normal(1),
        encoder_hidden_states=normal(1, WORDS, 3584), encoder_hidden_states_mask=None,
        img_shapes=[[(1, 64, 64)] * 3], return_dict=False,
    ))  # fmt: skip
    adapter = lora_parameters(network, LORA["qwen"])
    parts = tuple(_count(name) for name in ("qwen", "qwen-text", "qwen-vae"))
    need = _need(parts, qwen.QwenRefiner)
    for steps, name in (
        (2 * qwen.STEPS, "`qwen`, a crop of 1 MP in 40 steps"),
        (4, "`qwen` with Lightning, 4 steps"),
    ):
        yield from _pipeline(name, need, steps * step)
    yield Row("`qwen-refine-lora`, rank 16, with either", adapter, 2 * adapter, 0)
    step = operations(build("klein"), lambda m: m(
        hidden_states=normal(1, CROP, 128), timestep=normal(1), return_dict=False,
        encoder_hidden_states=normal(1, 512, 7680), img_ids=normal(1, CROP, 4),
        txt_ids=normal(1, 512, 4),
    ))  # fmt: skip
    need = _need((_count("klein"), _count("klein-vae")), klein.KleinRefiner)
    yield from _pipeline("`klein`, a crop of 1 MP in 4 steps", need, klein.STEPS * step)
    text = _count("klein-text")
    yield Row("its text encoder, once, on the CPU", text, 2 * text, 0, has_gpu=False)


def _need(parameters: tuple[int, ...], refiner: type[DiffusionRefiner]) -> PipelineNeed:
    """What the published files of a refiner ask of memory."""
    networks = zip(parameters, refiner.work.items(), strict=True)
    return PipelineNeed(
        tuple(Network(2 * count, work, name in refiner.parts) for count, (name, work) in networks)
    )


WAYS: dict[Way, str] = {
    "whole": "whole", "parts": "a network at a time", "four bits": "in four bits",
    "parts in four bits": "in four bits, a network at a time", "layers": "a layer at a time",
    "cpu": "CPU, float32",
}  # fmt: skip


def _pipeline(name: str, need: PipelineNeed, work: float) -> Iterator[Row]:
    """The ways of a refiner. Where weights travel to the GPU, that takes the time."""
    count = sum(n.weights for n in need.networks) // 2
    told = f"{name}; GPU"
    with_quantiser = replace(need, can_shrink=True)
    for plan in (*with_quantiser.on("cuda"), *need.on("cpu")):
        is_cpu, has_gpu = plan.device == "cpu", plan.keeps and plan.device != "cpu"
        row = WAYS[plan.way] if is_cpu else f"{told}, {WAYS[plan.way]}"
        yield Row(row, count, plan.peak, work, has_gpu, is_cpu)
        told = "GPU"


def _of_file(name: str, size: int) -> Row:
    """An ONNX file of `size` bytes, whose network is not described here."""
    count = size // 4
    return Row(f"`{name}`; CPU, its file's float32", count, 4 * count, 0, is_exact=False)


@cache
def _count(name: str) -> int:
    return parameters(build(name))


def _photo(side: int) -> torch.Tensor:
    return normal(1, 3, side, side)


def _bytes(count: float) -> str:
    return f"{count / 1e9:,.1f} GB" if count >= 1e9 else f"{count / 1e6:,.0f} MB"


def _seconds(seconds: float) -> str:
    if seconds == 0:
        return "–"
    if seconds >= 7200:
        return f"{seconds / 3600:,.0f} h"
    if seconds >= 120:
        return f"{seconds / 60:,.0f} min"
    return f"{seconds:,.0f} s" if seconds >= 2 else f"{seconds:.1g} s"


def main(write: Callable[[str], object] = sys.stdout.write) -> None:
    """Writes the page anew."""
    assert KEYS.is_dir(), "the descriptions of TRELLIS's parts lie beside their tests"
    transformers.utils.logging.set_verbosity_error()
    made, page = table(), PAGE.read_text(encoding="utf-8")
    start, end = _marks(page)
    PAGE.write_text(page[:start] + made + page[end:], encoding="utf-8")
    write(made)


if __name__ == "__main__":
    main()
