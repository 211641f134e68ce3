"""`objectmorpher models`: what is there of learned weights, getting and checking them."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from objectmorpher_core import lift, model_sets, models
from objectmorpher_core.lift.workers import file as worker_file
from objectmorpher_core.models import Added, CacheState, HubModel, HubState
from objectmorpher_core.models.fetch import check_online

from .idle_options import refuse_idle, said_on
from .terminal import UsageError, progress_bar

WIDE, NARROW = 34, 12  # characters of the list's columns
# What verifying leaves open of a folder of the user's.
UNHASHED = "yours: it has the kind and size of what was added, whose hash is not kept"
THERE = {"ok": "installed", "missing": "not installed", "damaged": "damaged"}


def run_models(options: argparse.Namespace) -> None:
    action, id = options.action, options.id
    if (action == "add") != (options.file is not None):
        raise UsageError(
            "a file is added as in: objectmorpher models add depth FILE.onnx, and a folder as in:"
            " objectmorpher models add sam2 FOLDER"
        )
    refuse_idle("models", said_on(options, options.parser))
    if options.is_offline:
        os.environ[models.OFFLINE] = "1"
    if action == "setup":
        _set_up(options)
    elif action == "add":
        _add(id, options.file, options.is_converted)
    elif action == "remove":
        _remove(id or "")
    elif action == "get":
        _get(options)
    else:
        _look(action, id)


def _add(id: str, source: Path, is_converted: bool) -> None:
    if is_converted:
        with progress_bar(f"Converting {source.name}") as progress:
            _write(_line_of_hub(models.convert_folder(id, source, progress)))
        return
    if id in {kind.id for kind in models.KINDS}:
        _write(_line_of_added(models.add(id, source)))
        return
    known = dict.fromkeys((*models.families(), *(model.id for model in models.hub_models())))
    if id not in known:
        names = ", ".join((*(kind.id for kind in models.KINDS), *known))
        raise UsageError(f"nothing can be added as {id!r}; known are {names}")
    _write(_line_of_hub(models.use_folder(id, source)))


def _remove(id: str) -> None:
    several = {model.id for model in models.hub_models()}
    if id in several or id in models.families():
        _remove_hub(id if id in several else _own_of(id))
    elif id in {weight.id for weight in models.weights()}:
        models.remove_weight(id)
    elif id in worker_file.worker_names():
        worker_file.forget_licence(id)
    elif id in {kind.id for kind in models.KINDS}:
        models.remove(id)
    else:
        told = f"there is no model called {id!r}" if id else "which model is to be removed"
        raise UsageError(f"{told}, see `models list`")


def _own_of(family: str) -> str:
    """The one model of a family that is a folder of the user's. Raises UsageError."""
    states = [models.look_hub(m.id) for m in models.hub_models() if m.family == family]
    own = [state.model.id for state in states if state.is_own]
    if len(own) != 1:
        there = [state.model.id for state in states if state.state != "missing"]
        told = f"these are there: {', '.join(there)}" if there else "none of them is there"
        raise UsageError(f"{family} is a family, remove one of its models by its id; {told}")
    return own[0]


def _remove_hub(id: str) -> None:
    """What happens to a folder of the user's, which stays where it is, is said."""
    before = models.look_hub(id)
    models.remove_hub(id)
    if before.is_own:
        after = models.look_hub(id)
        again = "" if after.state == "missing" else f"; {after.path} is used again"
        _write(f"{id}: {before.path} is no longer used{again}")


def _get(options: argparse.Namespace) -> None:
    """One; or all single files that editing uses. What else there is is got one by one."""
    id = options.id
    if id in {known.id for known in models.model_sets()}:
        _get_set(id, options)
        return
    if id in {model.id for model in models.hub_models()}:
        wanted = models.missing(id)
        if wanted and all(model.repository for model in wanted):
            for model in wanted:
                models.check_licence(model, options.accept_licence or "")
            _ask(wanted, options.is_agreed)
        with progress_bar(f"Getting {id}") as progress:
            models.get_all(wanted, id, progress, options.accept_licence or "")
        _write(f"{id}: {models.place(id)}")
        return
    if id in worker_file.worker_names():
        worker_file.accept_licence(id, options.accept_licence or "")
        _write(_line_of_worker(id))
        return
    usual = [weight for weight in models.weights() if weight.category == "edit"]
    for weight in [models.weight(id)] if id else usual:
        with progress_bar(f"Getting {weight.id}") as progress:
            at = models.fetch(weight.id, progress)
        _write(f"{weight.id}: {at}")


def _get_set(id: str, options: argparse.Namespace) -> None:
    """All of a set: first what each would do here, then one question."""
    found = next(o for o in model_sets.offers() if o.set.id == id)
    for step in found.steps:
        how = step.plan.in_words if step.plan else step.why_not or "beside the others"
        _write(f"{step.model.id:<{WIDE}}{_size(step.model.size):>10}  {step.model.licence}, {how}")
    told = f"{id}: {_size(found.missing)} to download, licences {', '.join(found.licences)}"
    if found.missing:
        _consent(told, id, options.is_agreed)
    with progress_bar(f"Getting {id}") as progress:
        model_sets.get_set(found, progress, options.accept_licence or "")
    _write(f"{id}: {models.folder()}")


def _set_up(options: argparse.Namespace) -> None:
    """The environment that holds PyTorch: made, brought up to date, or removed."""
    from objectmorpher_core.base import torch_environment
    from objectmorpher_core.models import torch_setup

    if options.is_undone:
        size = torch_setup.unmake()
        _write(f"removed {torch_environment.folder()}, {_size(size)}")
        return
    if options.id:
        raise UsageError(f"models setup takes no name such as {options.id!r}")
    if options.wheels and not options.wheels.is_dir():
        raise UsageError(f"{options.wheels} is no folder")
    build = torch_setup.build_for(torch_setup.this_machine(), options.build or "")
    plan = torch_setup.plan(build, options.wheels)
    told = f"PyTorch in the build {build.name}, because {build.why}"
    if plan.wheels is None:
        told += f": about {plan.download / 1e9:.1f} GB to download"
        told += f" and {plan.disk / 1e9:.1f} GB in {plan.folder}"
        told += f", in {plan.minutes} minutes at 80 Mbit/s"
    else:
        told += f": from {plan.wheels} into {plan.folder}"
    _consent(told, "PyTorch", options.is_agreed, "install")
    with progress_bar("Installing PyTorch") as progress:
        made = torch_setup.make(plan, progress)
    _write(f"PyTorch {made.torch}: {plan.folder}, {_size(made.size)}")


def _ask(wanted: Sequence[HubModel], is_agreed: bool) -> None:
    """The user's consent to downloads, the last of which the others are needed for.

    Raises UsageError without it.
    """
    *needed, model = wanted
    homes, licences = (
        " and ".join(dict.fromkeys(values))
        for values in ((m.home for m in wanted), (m.licence for m in wanted))
    )
    names = " with ".join([model.id, *(each.id for each in needed)])
    size = _size(sum(each.size for each in wanted))
    told = f"{names}: {size} from {homes}, licence {licences}"
    if any(map(models.has_pickles, wanted)):
        told += "; it comes as pickles, of which nothing but the numbers is read"
    _consent(told, model.id, is_agreed)


def _consent(told: str, id: str, is_agreed: bool, verb: str = "download") -> None:
    """The user's consent to what is asked. Raises UsageError without it."""
    if verb == "download":
        check_online(id)
    if is_agreed:
        sys.stderr.write(f"{told}\n")
        return
    if not sys.stdin.isatty():
        raise UsageError(f"{told}; to {verb} it add --yes")
    sys.stderr.write(f"{told}. {verb.capitalize()} it? [y/N] ")
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise UsageError(f"{id} was not {verb}ed")


def _look(action: str, id: str | None) -> None:
    """Lists one of them or all, prints their places, or hashes them."""
    workers = tuple(name for name in worker_file.worker_names() if id in (None, name))
    others = {known.id for known in (*models.KINDS, *models.hub_models())}
    is_worker = id is not None and bool(workers)
    check = models.verify if action == "verify" else models.look
    states = () if id in others or is_worker else check(id)
    brought = tuple(models.added(kind.id) for kind in models.KINDS if id in (None, kind.id))
    look = models.verify_hub if action == "verify" else models.look_hub
    several = tuple(look(model.id) for model in models.hub_models() if id in (None, model.id))
    if action != "list" and id is None:  # what nobody has got is only listed
        several = tuple(state for state in several if state.state != "missing")
        states = tuple(s for s in states if s.weight.category == "edit" or s.state != "missing")
    if action == "list":
        lines = [
            *map(_line_of, states), *map(_line_of_added, brought),
            *map(_line_of_hub, several), *map(_line_of_worker, workers),
        ]  # fmt: skip
        _write("\n".join(lines))
        return
    broken = []
    for found in (*states, *brought, *several):
        name = _name_of(found)
        # What only a user can bring is not missed, unless it is asked for.
        is_optional = isinstance(found, Added) and found.state == "missing" and not id
        if action == "verify":
            state = THERE["missing"] if found.state == "missing" else found.state
            reason = "optional" if is_optional else getattr(found, "reason", "")
            if isinstance(found, HubState) and found.is_own and found.state == "ok":
                reason = UNHASHED
            _write(f"{name}: {state}{f' ({reason})' if reason else ''}")
        elif found.state == "ok":
            _write(str(found.path))
        broken += [name] if found.state != "ok" and not is_optional else []
    if broken:
        raise UsageError(f"{', '.join(broken)}: not installed or damaged, see `models list`")


def _name_of(found: CacheState | Added | HubState) -> str:
    if isinstance(found, CacheState):
        return found.weight.id
    return found.kind.id if isinstance(found, Added) else found.model.id


def _line_of(state: CacheState) -> str:
    weight = state.weight
    there = THERE[state.state]
    return _columns(weight.id, _size(weight.size), weight.licence, there, weight.purpose)


def _line_of_hub(found: HubState) -> str:
    model = found.model
    there, purpose = THERE[found.state], model.purpose
    if found.is_own:
        there, purpose = "yours" if found.state == "ok" else there, f"{purpose} ({found.path})"
    elif not model.repository:
        purpose += f"; models add {model.id} FOLDER, from {model.home}"
    licence = model.licence if model.is_free else f"{model.licence}*"
    return _columns(model.id, _size(model.size), licence, there, purpose)


def _line_of_added(own: Added) -> str:
    """Which of the user's files it is, or which it could be."""
    kind = own.kind
    if own.state == "ok":
        told = f"{kind.purpose} ({own.name}, sha256 {own.sha256})"
        return _columns(kind.id, _size(own.size), "yours", THERE["ok"], told)
    told = f"{kind.purpose}; models add {kind.id} FILE, {kind.example}"
    return _columns(kind.id, "", "yours", THERE[own.state], told)


def _line_of_worker(name: str) -> str:
    """A program of the user's that lifts: its files are its own matter."""
    try:
        worker = worker_file.read_worker(name)
    except lift.LiftError as error:
        return _columns(name, "", "", "damaged", str(error))
    licence = (worker.licence or "not told") + ("" if worker.is_free else "*")
    missing = worker.missing()
    told = f"a worker of yours that lifts{f'; {missing}' if missing else ''}"
    return _columns(name, "", licence, "not usable" if missing else "yours", told)


def _columns(id: str, size: str, licence: str, there: str, purpose: str) -> str:
    return f"{id:<{WIDE}}{size:>10}  {licence:<{NARROW}} {there:<14} {purpose}"


def _size(count: float) -> str:
    """Bytes for people."""
    if count < 5e4:
        return f"{count / 1e3:.0f} kB"
    return f"{count / 1e6:.1f} MB" if count < 1e9 else f"{count / 1e9:.2f} GB"


def _write(line: str) -> None:
    sys.stdout.write(f"{line}\n" if line else "")
