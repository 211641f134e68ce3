"""`objectmorpher train`: makes the product's own networks."""

from __future__ import annotations

import argparse
import json
import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from objectmorpher.cli.command_parser import Subcommand, add_ray, add_subcommands, check_ray
from objectmorpher.cli.terminal import UsageError, progress_bar
from objectmorpher_core.base.files import write_all

NEEDED = {"torch": "torch", "onnx": "onnx", "skimage": "scikit-image", "sklearn": "scikit-learn"}
MOST_REASONS = 8  # that are told on the terminal
MEASURED = 3  # steps of --dry-run


def add_train(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher train`."""
    parser.description = "Trains the networks that are the product's own: docs/training.md."
    add_subcommands(parser, "what", (
        Subcommand(
            "shape", "the shape network, on endless made-up objects", _add_shape, _train_shape
        ),
        Subcommand(
            "flat", "what the shape network says of flatness, by itself", _add_flat, _train_flat
        ),
        Subcommand(
            "shadow", "the network that finds shadows, on endless made-up scenes", _add_shadow,
            _train_shadow,
        ),
        Subcommand(
            "rods", "the network that finds how handles lie, on made-up vessels", _add_rods,
            _train_rods,
        ),
        Subcommand(
            "pairs", "triplets for the LoRA, out of pairs of pictures", _add_pairs, _make_pairs
        ),
        Subcommand(
            "lora", "the LoRA that makes coarse edits look photographed", _add_lora, _train_lora
        ),
    ))  # fmt: skip


def _add_shape(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Trains on endless made-up objects; called again with the same options it goes on."
    )
    add = parser.add_argument
    add("--samples", type=int, default=8192, metavar="N", help="objects to make")
    add("--passes", type=float, default=4.0, metavar="P", help="over all of them")
    add("--hold-out", type=_words, metavar="A,B", help="families that are not trained on")
    add("--start", type=Path, metavar="ONNX", help="exported weights to go on from")
    add("--seed", type=int, default=0, help="0 to 49; another seed draws other samples")
    add("--also", action="append", default=[], metavar="SEED:N[:A,B]",
        help="N samples of another seed as well, of these families only")  # fmt: skip
    _add_run(parser, "shape.onnx")
    add("--report", type=Path, metavar="F.json", help="figures; default: beside the weights")


def _add_flat(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Trains whether a thing is flat further, on made-up things. The surfaces stay as they are."
    )
    add = parser.add_argument
    add("--things", type=int, default=1100, metavar="N", help="to make, default 1100")
    add("--start", type=Path, metavar="ONNX", help="exported weights; default: those that ship")
    add("--folder", type=Path, required=True, metavar="DIR", help="what it is trained on")
    add("-o", "--output", type=Path, metavar="F.onnx", help="default: shape.onnx in the folder")


def _add_shadow(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Trains on endless made-up scenes; called again with the same options it goes on."
    )
    add = parser.add_argument
    add("--scenes", type=int, default=2880, metavar="N", help="to draw, default 2880")
    add("--steps", type=int, default=5000, metavar="N", help="of 32 samples, default 5000")
    add("--start", type=Path, metavar="ONNX", help="exported weights to go on from")
    add("--grounds", type=Path, metavar="FOLDER", help="pictures of grounds to draw with")
    add("--seed", type=int, default=0, help="another one draws other scenes")
    _add_run(parser, "shadow.onnx")


def _add_rods(parser: argparse.ArgumentParser) -> None:
    parser.description = "Trains on made-up vessels with handles; those made are kept."
    add = parser.add_argument
    add("--samples", type=int, default=3072, metavar="N", help="handles to draw, default 3072")
    add("--steps", type=int, default=2500, metavar="N", help="of 32 samples, default 2500")
    add("--seed", type=int, default=0, help="another one draws other handles")
    add("--folder", type=Path, required=True, metavar="DIR", help="what it is trained on")
    add("-o", "--output", type=Path, metavar="F.onnx", help="default: rods.onnx in the folder")


def _add_run(parser: argparse.ArgumentParser, weights: str) -> None:
    """Where a network of ours is trained, for how long, and what comes of it."""
    add = parser.add_argument
    add("--folder", type=Path, required=True, metavar="DIR",
        help="what it is trained on, and checkpoints")  # fmt: skip
    add("--minutes", type=float, metavar="M", help="at most; go on with another call")
    add("-o", "--output", type=Path, metavar="F.onnx", help=f"default: {weights} in the folder")


def _add_pairs(parser: argparse.ArgumentParser) -> None:
    parser.description = "Lifts each object out of one picture and puts it where the other has it."
    add = parser.add_argument
    add("source", type=Path, metavar="SOURCE",
        help="Subjects200K's tables or folder, a folder of pairs, or a video")  # fmt: skip
    add("out", type=Path, metavar="OUT", help="folder of shards; called again it goes on")
    add("--layout", default="auto", metavar="L", help="auto, subjects, pairs or frames")
    add("--one-way", action="store_true", help="do not also use each pair the other way round")
    add("--every", type=float, default=1.0, metavar="S", help="seconds between a video's frames")
    add("--padding", type=float, metavar="X",
        help="around the halves of a picture, x its height; default Subjects200K's")  # fmt: skip
    add("--poses", default="own", metavar="P", help="own, cupid, or a worker: docs/training.md")
    add("--segment", default="auto", metavar="S", help="who selects the subject")
    add("--lift", default="auto", metavar="L", help="who lifts it")
    add("--inpaint", default="auto", metavar="I", help="who fills in the background")
    add("--size", type=int, default=1024, metavar="PX", help="longer side at most, default 1024")
    add("--least-iou", type=float, metavar="X", help="of the outlines, registered; default 0.75")
    add("--shard-size", type=int, default=32, metavar="N", help="pairs of a shard, default 32")
    add_ray(parser)
    add("--made", type=int, default=0, metavar="N", help="first fill SOURCE with N made-up pairs")
    add("--seed", type=int, default=0, metavar="N", help="of all that is random")


def _add_lora(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Trains on triplets; called again it goes on. Several GPUs or machines: accelerate launch."
    )
    add = parser.add_argument
    add("triplets", type=Path, nargs="?", metavar="DATA", help="folder made by train pairs")
    add("out", type=Path, nargs="?", metavar="OUT", help="checkpoint, losses, pictures, lora/")
    add("--model", default="qwen", metavar="M", help="qwen or klein, default qwen")
    add("--weights", type=Path, metavar="DIR",
        help="pipeline's folder; default the model manager's")  # fmt: skip
    add("--cache", type=Path, metavar="DIR", help="latents; default DATA/latents")
    add("--steps", type=int, default=2000, metavar="N", help="in all, default 2000")
    add("--size", type=int, default=1024, metavar="PX", help="pictures have its square; 1024")
    add("--rank", type=int, default=16, metavar="R", help="default 16")
    add("--rate", type=float, default=1e-4, metavar="X", help="AdamW's, default 1e-4")
    add("--ratio", type=float, default=3.0, metavar="X", help="LoRA+'s, default 3")
    add("--batch", type=int, default=4, metavar="N",
        help="triplets of a step, over all processes; default 4")  # fmt: skip
    add("--warm-up", type=int, default=0, metavar="N", help="steps in which the rate rises")
    add("--ema", type=float, default=0.0, metavar="X",
        help="keep and ship a moving mean of the weights, as 0.999")  # fmt: skip
    add("--held-out", type=int, default=4, metavar="N", help="triplets not trained on; default 4")
    add("--save-every", type=int, default=50, metavar="N", help="steps, default 50")
    add("--look-every", type=int, default=250, metavar="N", help="at those held out; 0: never")
    add("--sample-steps", type=int, default=20, metavar="N", help="of their pictures; 0: none")
    add("--number", default="auto", metavar="T",
        help="bfloat16 or float32; auto: bfloat16 on a GPU")  # fmt: skip
    add("--base", default="whole", metavar="B",
        help="the frozen network: whole, or nf4, in four bits (QLoRA)")  # fmt: skip
    add("--seed", type=int, default=0, metavar="N", help="of order, noise and the adapter")
    add("--dry-run", action="store_true",
        help="measure steps at the published size with random weights, no DATA")  # fmt: skip


def _make_pairs(options: argparse.Namespace) -> None:
    """Shards that are not there yet."""
    from ..training.composition import shards as disk
    from ..training.composition.pictures import PADDING
    from ..training.composition.sources import SourceReading, find_pairs
    from ..training.composition.triplet import TripletLimits, TripletPlan

    check_ray(options)
    if options.size < 64 or options.made < 0:
        raise UsageError("--size is at least 64 px, --made not negative")
    least = {} if options.least_iou is None else {"least_iou": options.least_iou}
    how = TripletPlan(
        options.segment, options.lift, options.inpaint, options.poses, longest=options.size,
        seed=options.seed, limits=TripletLimits(**least),
    )  # fmt: skip
    how.check()
    _check_folder(options.out)
    if options.made:
        _made_up(options)
    padding = PADDING if options.padding is None else options.padding
    looking = SourceReading(options.layout, not options.one_way, options.every, padding)
    all_of_them = disk.shards_of(find_pairs(options.source, looking), options.shard_size)
    disk.begin(options.out, all_of_them, how)
    left = disk.left_over(options.out, all_of_them)
    with progress_bar("Making triplets") as progress:
        if options.ray is not None and left:
            from ..training.composition.spread_shards import write_shards

            write_shards(options.out, left, how, options.ray, progress)
        else:
            for k, shard in enumerate(left):
                step = _part_of(progress, k, len(left))
                disk.write_shard(options.out, shard, how, step)
    _say_pairs(disk.finish(options.out, all_of_them), options.out)


def _train_lora(options: argparse.Namespace) -> None:
    """Trains, or measures."""
    from ..training.composition import edit_models
    from ..training.composition.lora_plan import LoraPlan

    if absent := _absent("torch", "diffusers", "transformers", "peft", "accelerate", "safetensors"):
        raise UsageError(f"training needs {absent}: `pip install 'objectmorpher[models,research]'`")
    model = edit_models.load(options.model)
    plan = LoraPlan(
        options.model, options.size, options.rank, options.rate, options.ratio,
        batch=options.batch, warm_up=options.warm_up, mean=options.ema, held_out=options.held_out,
        number=_number(options.number), seed=options.seed, base=options.base,
    )  # fmt: skip
    plan.check()
    if options.dry_run:
        _say_estimate(plan)
        _measure(plan, max(min(options.steps, MEASURED), 1))
        return
    if options.triplets is None or options.out is None:
        raise UsageError("name the folder of triplets and the one to train in: DATA OUT")
    least = min(options.steps, options.save_every)
    if least < 1 or min(options.look_every, options.sample_steps) < 0:
        raise UsageError("--steps and --save-every are at least 1, the others not negative")
    _check_folder(options.out)
    from ..training.composition.train_lora import Course, Trainer, TrainingFolders

    weights = edit_models.folder_of(model, options.weights)
    cache = options.cache or options.triplets / "latents"
    options.out.mkdir(parents=True, exist_ok=True)
    _say_estimate(plan)
    places = TrainingFolders(options.triplets, options.out, weights, cache)
    course = Course(options.steps, options.save_every, options.look_every, options.sample_steps)
    with progress_bar("Training") as progress:
        trainer = Trainer(places, plan, progress)
        file = trainer.train(course, progress)
    if trainer.accelerator.is_main_process:
        print(f"{file}; use it by: objectmorpher models add {model.name}-refine-lora {file.parent}")


def _number(name: str) -> str:
    from objectmorpher_core.models import device

    from ..training.composition.lora_plan import NUMBERS

    if name not in NUMBERS:
        raise UsageError(f"--number is one of {', '.join(NUMBERS)}, not {name!r}")
    has_gpu = "cuda" in device.devices()
    return ("bfloat16" if has_gpu else "float32") if name == "auto" else name


def _say_estimate(plan: Any) -> None:
    """By the first process of those that `accelerate launch` or torchrun has started."""
    from ..training.composition import estimate

    if os.environ.get("RANK", "0") == "0":
        print(estimate.told(plan, estimate.table(plan)), flush=True)


def _measure(plan: Any, count: int) -> None:
    from ..training.composition.measure import measure

    found = measure(plan, count)
    peak = "" if found.peak is None else f", {found.peak / 2**30:.1f} GiB at most"
    times = ", ".join(f"{seconds:.2f}" for seconds in found.steps)
    print(
        f"{plan.model}, {plan.side} x {plan.side} px, {found.number}, on {found.device}:"
        f" {found.parameters / 1e9:.2f} B weights, {found.trained / 1e6:.1f} M trained,"
        f" {found.tokens} tokens; loaded in {found.loading:.1f} s, steps of {times} s{peak}"
    )


def _made_up(options: argparse.Namespace) -> None:
    if absent := _absent("skimage", "sklearn"):
        raise UsageError(f"--made needs {absent}: `pip install 'objectmorpher[research]'`")
    from ..training.composition.made_pairs import write_made_pairs

    with progress_bar("Making pairs up") as progress:
        side = min(options.size, 512)
        write_made_pairs(options.source, options.made, side, options.seed, progress)


def _say_pairs(found: dict[str, Any], out: Path) -> None:
    print(f"{out}: {found['made']} triplets, {found['rejected']} pairs rejected")
    often = sorted(found["reasons"].items(), key=lambda item: -item[1])
    for sentence, count in often[:MOST_REASONS]:
        print(f"  {count} x {sentence}")
    sys.stdout.flush()


def _part_of(progress: Any, k: int, count: int) -> Any:
    from objectmorpher_core.base.progress import part

    return part(progress, k / count, (k + 1) / count)


def _absent(*modules: str) -> str:
    """Packages of these that are not installed, in words."""
    names = [NEEDED.get(module, module) for module in modules if find_spec(module) is None]
    return " and ".join(names)


def _check_installed() -> None:
    """Raises UsageError where a package is missing that training needs."""
    if absent := _absent(*NEEDED):
        raise UsageError(f"training needs {absent}: `pip install {absent.replace(' and ', ' ')}`")


def _check_folder(folder: Path) -> None:
    """Refuses, before any work, a folder that is none or cannot be made."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise UsageError(f"{there} is a file, not a folder")


def _train_shadow(options: argparse.Namespace) -> None:
    """Makes scenes, trains, and writes weights."""
    _check_installed()
    if min(options.scenes, options.steps) < 1 or options.seed < 0:
        raise UsageError("--scenes and --steps are at least 1, --seed is not negative")
    from ..training.train_shadow import ShadowPlan, export, train

    _check_folder(options.folder)
    plan = ShadowPlan(options.scenes, options.steps, seed=options.seed, grounds=options.grounds)
    with progress_bar("training") as progress:
        net = train(options.folder, plan, options.minutes, progress, options.start)
    output = options.output or options.folder / "shadow.onnx"
    print(f"{output}: {export(net, output)}")


def _train_rods(options: argparse.Namespace) -> None:
    """Makes handles, trains, measures, and writes weights."""
    _check_installed()
    if min(options.samples, options.steps) < 1 or options.seed < 0:
        raise UsageError("--samples and --steps are at least 1, --seed is not negative")
    from ..training.train_rods import RodPlan, export, train

    _check_folder(options.folder)
    plan = RodPlan(options.samples, options.steps, seed=options.seed)
    with progress_bar("training") as progress:
        net, off = train(options.folder, plan, progress)
    output = options.output or options.folder / "rods.onnx"
    print(f"{output}: {export(net, output)}")
    print(", ".join(f"{name} {value:.1f} degrees" for name, value in off.items()))


def _train_shape(options: argparse.Namespace) -> None:
    """Makes samples, trains, measures, and writes weights and figures."""
    _check_installed()
    from ..training import flatness
    from ..training.export_shape import export
    from ..training.shapes.families import FAMILIES
    from ..training.train_shape import SampleSet, TrainingPlan, figures, train, trained

    held_out = tuple(options.hold_out or ())
    also = []
    for text in options.also:
        seed, _, rest = text.partition(":")
        count, _, names = rest.partition(":")
        if not (seed.isdecimal() and count.isdecimal()):
            raise UsageError(f"--also {text}: write SEED:N or SEED:N:FAMILY,FAMILY")
        also.append(SampleSet(int(seed), int(count), tuple(_words(names))))
    unknown = sorted({*held_out, *(name for own in also for name in own.families)} - set(FAMILIES))
    if unknown:
        raise UsageError(f"there is no family {unknown[0]!r}; there are {', '.join(FAMILIES)}")
    if options.start is not None and not options.start.is_file():
        raise UsageError(f"there is no file {options.start}")
    _check_folder(options.folder)
    plan = TrainingPlan(
        options.samples, options.passes, held_out=held_out, seed=options.seed, also=tuple(also)
    )
    with progress_bar("training") as progress:
        checkpoint = train(options.folder, plan, options.minutes, progress, options.start)
    net = trained(checkpoint)
    with progress_bar("what is flat") as progress:
        files = sorted((options.folder / "samples").glob("*.npz"))
        flatness.fit(net.flat, flatness.samples_of(files, progress))
    found = figures(checkpoint, net)
    weights = options.output or options.folder / "shape.onnx"
    found["sha256"] = export(net, weights)
    report = options.report or weights.with_suffix(".json")
    write_all({report: json.dumps(found, indent=1).encode()})
    print(f"{weights}, figures in {report}")


def _train_flat(options: argparse.Namespace) -> None:
    """Makes samples, trains, and writes weights and figures."""
    _check_installed()
    from objectmorpher_core.models import registry

    from ..training.train_flat import train_flat

    start = options.start or Path(registry.__file__).with_name("shape.onnx")
    if not start.is_file():
        raise UsageError(f"there is no file {start}")
    if options.things < 3:
        raise UsageError("--things: at least 3, one of each kind")
    _check_folder(options.folder)
    weights = options.output or options.folder / "shape.onnx"
    with progress_bar("what is flat") as progress:
        found = train_flat(options.folder, options.things, start, weights, progress)
    report = weights.with_suffix(".json")
    write_all({report: json.dumps(found, indent=1).encode()})
    print(f"{weights}, figures in {report}")


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]
