"""Measures the networks at their real sizes, with random weights, on this machine's device.

`python docs/estimates/measure_networks.py [NAME ...]` needs the extra `models`, no weights and no
network; without names it does what fits the device. Every name is measured in a process of its own,
so that its peak memory is its own: on a GPU what PyTorch took, on the CPU what the process grew by.
A flow is followed for as many steps as published on a GPU, and for one step on the CPU. There the
processor's own seconds are told, too, about the same on a machine that has other work; those of
the wall are left out where less than HAD of the cores could be had. The figures are kept in
measured.json, by device, and the table of docs/model-measurements.md is written from it. A step of
training is measured by `objectmorpher train lora --measure`.
"""

from __future__ import annotations

import json
import multiprocessing
import platform
import resource
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from published import SAM, SAM2, build, parameters, trellis_parts
from torch import Tensor

from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.plate import latent_diffusion
from objectmorpher_core.compose.refine import klein
from objectmorpher_core.lift.trellis.configs import Sampling
from objectmorpher_core.lift.trellis.generator import sample
from objectmorpher_core.lift.trellis.voxels import Voxels
from objectmorpher_research.training.composition import edit_models

HERE = Path(__file__).parent
KEPT, PAGE = HERE / "measured.json", HERE.parent / "model-measurements.md"
START, END = "<!-- measured -->\n", "<!-- end of measured -->\n"
HEAD = ("network", "how", "number", "parameters", "seconds", "of a processor", "peak memory")
RUNS = 3  # the median of them, after one that is not counted
LONG = 20.0  # s of a processor: a run that takes longer is done once
HAD = 0.8  # x the cores
GRID, RADIUS, THICKNESS = 64, 22.2, 1.74  # cells; a shell stands for an object
FILL = "pixelhacker, whole"
REFINERS = ("klein", "qwen")
LARGE = (FILL, *REFINERS)  # not on the CPU unless they are named
SIDE = 1024  # px of what a refiner is shown
TRELLIS = Sampling(steps=12, guidance=7.5, interval=(0.5, 0.95), rescale_t=3.0)
WORDS = 1374  # tokens of a picture of 518 px: DINOv2's with four registers


@dataclass(frozen=True)
class Figure:
    """Of one network on one device."""

    name: str
    how: str
    number: str
    parameters: int
    seconds: float | None  # the median; None: the machine was too busy to tell
    peak: int  # bytes, weights and work
    processor: float | None = None  # s of all cores together, on a CPU


@dataclass(frozen=True)
class Job:
    """What is run, and what is counted."""

    run: Callable[[], object]
    how: str
    parameters: int


Maker = Callable[[str, torch.dtype], Job]  # of a device and a number


def main(names: list[str]) -> None:
    """Measures, keeps the figures and writes the table."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    own = {figure["name"]: figure for figure in kept.get(_device_name(device), [])}
    makers = _makers()
    if unknown := sorted(set(names) - makers.keys()):
        sys.exit(f"{unknown[0]} is no network that is known here; known are {', '.join(makers)}")
    processes = multiprocessing.get_context("spawn")
    for name in names or (makers if device == "cuda" else [n for n in makers if n not in LARGE]):
        with processes.Pool(1) as pool:
            figure = pool.apply(_figure, (name, device))
        print(*_cells(figure), sep="  ", flush=True)
        own[name] = asdict(figure)
        kept[_device_name(device)] = [own[known] for known in makers if known in own]
        KEPT.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
        write_page(kept)


def write_page(kept: Mapping[str, list[dict[str, Any]]]) -> None:
    """The tables of docs/model-measurements.md, one for each device."""
    page = PAGE.read_text(encoding="utf-8")
    start, end = page.index(START) + len(START), page.index(END)
    PAGE.write_text(page[:start] + tables(kept) + page[end:], encoding="utf-8")


def tables(kept: Mapping[str, list[dict[str, Any]]]) -> str:
    """In Markdown."""
    lines = []
    for device, figures in kept.items():
        lines += [f"{device}:", "", _line(HEAD), _line(["---"] * 3 + ["---:"] * 4)]
        lines += [_line(_cells(Figure(**figure))) for figure in figures]
        lines.append("")
    return "\n".join(lines)


def _line(cells: Any) -> str:
    return f"| {' | '.join(cells)} |"


def _cells(figure: Figure) -> tuple[str, ...]:
    return (
        f"`{figure.name}`", figure.how, figure.number, f"{figure.parameters / 1e6:,.0f} M",
        _told(figure.seconds), _told(figure.processor), f"{figure.peak / 1e9:.1f} GB",
    )  # fmt: skip


def _told(seconds: float | None) -> str:
    if seconds is None:
        return "–"
    return f"{seconds:.1f}" if seconds >= 1 else f"{seconds:.2g}"


def _figure(name: str, device: str) -> Figure:
    """In a process of its own."""
    number = torch.float32 if device == "cpu" else torch.bfloat16
    before = _resident()
    with torch.inference_mode():
        job = _makers()[name](device, number)
        took = [_run(job, device)]
        if device == "cuda" or took[0].processor < LONG:
            took = [_run(job, device) for _ in range(RUNS)]
    wall = statistics.median(run.wall for run in took)
    peak = torch.cuda.max_memory_allocated() if device == "cuda" else _peak() - before
    told = str(number).removeprefix("torch.")
    if device == "cuda":
        return Figure(name, job.how, told, job.parameters, wall, peak)
    processor = statistics.median(run.processor for run in took)
    is_told = processor > HAD * torch.get_num_threads() * wall
    return Figure(name, job.how, told, job.parameters, wall if is_told else None, peak, processor)


@dataclass(frozen=True)
class Took:
    """Seconds of a run."""

    wall: float
    processor: float  # of all cores together


def _run(job: Job, device: str) -> Took:
    wall, processor = time.perf_counter(), time.process_time()
    job.run()
    if device == "cuda":
        torch.cuda.synchronize()
    return Took(time.perf_counter() - wall, time.process_time() - processor)


def _makers() -> dict[str, Maker]:
    found: dict[str, Maker] = {name: partial(_encoder, name, 1024) for name in (*SAM2, *SAM)}
    found |= {"sam3": partial(_encoder, "sam3", 1008), "dino": partial(_seen, "dino")}
    found |= {"depth-anything-v2-small": partial(_seen, "depth")}
    for part in trellis_parts("trellis"):
        found[f"trellis {part.split('_dit')[0].split('_conv')[0].split('_swin')[0]}"] = partial(
            _trellis_part, part
        )
    found |= {"pixelhacker": _pixelhacker_step, FILL: _pixelhacker}
    return found | {name: partial(_refiner, name) for name in REFINERS}


def _network(name: str, device: str, number: torch.dtype) -> Any:
    """With the numbers that its layers start with."""
    torch.set_default_dtype(number)
    try:
        return build(name, device)
    finally:
        torch.set_default_dtype(torch.float32)


def _encoder(name: str, side: int, device: str, number: torch.dtype) -> Job:
    network = _network(name, device, number)
    photo = torch.randn(1, 3, side, side, device=device, dtype=number)
    return Job(lambda: network.get_image_embeddings(photo), "a photo", parameters(network))


def _seen(name: str, device: str, number: torch.dtype) -> Job:
    network = build(name, device)  # in float32, as it is used
    photo = torch.randn(1, 3, 518, 518, device=device)
    return Job(lambda: network(photo), "a picture of 518 px", parameters(network))


def _trellis_part(name: str, device: str, number: torch.dtype) -> Job:
    """A flow with the published number of steps and guidance, or a decoder."""
    part: Any = build(name, device)
    lower = part.lower_precision()
    for key, weight in (*part.named_parameters(), *part.named_buffers()):
        if key in lower:
            weight.data = weight.data.to(number)
    part.precision = number
    count, voxels = parameters(part), _shell(device)
    if "flow" not in name:
        if name.startswith("ss_"):
            latents = torch.randn(1, 8, 16, 16, 16, device=device)
            return Job(lambda: part(latents), "once", count)
        filled = torch.randn(1, len(voxels), 8, device=device)
        return Job(lambda: part(filled, voxels), f"once, {len(voxels):,} cells", count)
    is_first = name.startswith("ss_")
    shape = (1, 8, 16, 16, 16) if is_first else (1, len(voxels), part.form.out_channels)
    seen = torch.randn(1, WORDS, 1024, device=device)
    more = () if is_first else (voxels,)

    def velocity(x: Tensor, moment: Tensor, is_shown: bool) -> Tensor:
        return part(x, moment, seen if is_shown else torch.zeros_like(seen), *more)

    noise = torch.randn(shape, device=device)
    cells = "" if is_first else f", {len(voxels):,} cells"
    if device == "cpu":
        return Job(lambda: velocity(noise, torch.ones(1), True), f"a forward{cells}", count)
    how = f"{TRELLIS.steps} steps with guidance{cells}"
    return Job(lambda: sample(velocity, noise, TRELLIS, silent, ""), how, count)


def _shell(device: str) -> Voxels:
    """Cells of a sphere's surface, as many as an object's surface has."""
    axes = np.indices((GRID,) * 3) - (GRID - 1) / 2
    away = np.sqrt((axes**2).sum(0))
    return Voxels.of(torch.from_numpy(np.abs(away - RADIUS) < THICKNESS / 2).to(device))


def _pixelhacker_step(device: str, number: torch.dtype) -> Job:
    """Both the step with what is asked for and the one without, as they are run: together."""
    network: Any = build("pixelhacker", device).to(number)
    ids = torch.arange(latent_diffusion.IDS, device=device).view(2, -1)
    latents = torch.randn(2, 9, 64, 64, device=device, dtype=number)
    time_now = torch.tensor(1, device=device)
    return Job(lambda: network(latents, time_now, ids), "a step of 20, 512 px", parameters(network))


def _pixelhacker(device: str, number: torch.dtype) -> Job:
    network: Any = build("pixelhacker", device).to(number)
    codec: Any = build("pixelhacker-vae", device)
    picture = np.random.default_rng(0).random((512, 512, 3), np.float32)
    hole = np.zeros((512, 512), bool)
    hole[128:384, 128:384] = True
    return Job(
        lambda: latent_diffusion.sample(network, codec, picture, hole, silent, 0),
        f"a fill of {latent_diffusion.STEPS} steps, 512 px",
        parameters(network) + parameters(codec),
    )  # fmt: skip


def _refiner(name: str, device: str, number: torch.dtype) -> Job:
    """Of klein a whole picture of 1024 px, of Qwen a step of the transformer."""
    model = edit_models.load(name)
    network = _network(name, device, number)
    at = model.made_up(SIDE, str(number).removeprefix("torch."), device)
    steps = klein.STEPS if name == "klein" and device == "cuda" else 1

    def run() -> None:
        noisy = at.target
        for k in range(steps):
            sigma = torch.full((1,), 1 - k / steps, device=device, dtype=number)
            noisy = noisy - model.velocity(network, noisy, sigma, at) / steps

    return Job(run, f"{steps} step{'s' * (steps > 1)}, {SIDE} px", parameters(network))


def _device_name(device: str) -> str:
    if device == "cuda":
        return torch.cuda.get_device_name()
    return f"{torch.get_num_threads()} processor cores, {platform.machine()}"


def _resident() -> int:
    """Bytes of main memory that this process holds."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    except OSError:  # not Linux
        return _peak()
    return int(pages) * resource.getpagesize()


def _peak() -> int:
    """Bytes that it held at most."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


if __name__ == "__main__":
    main(sys.argv[1:])
