"""Takes the numbers out of a pickled weight file: what comes out is safetensors.

`python tensors_only.py [[SOURCE, TARGET], ...]` prints one line of JSON: {} or {"error": sentence}.
PyTorch's `weights_only` reader knows tensors and plain containers, and refuses everything that
could run. It runs in a process of its own, which holds nothing of ours.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

SAFE_SINCE = (2, 6)  # torch; before it `weights_only` could be got round


def convert(pairs: Mapping[Path, Path]) -> None:
    """Writes the targets of some sources, all or none. Raises ModelError: one sentence."""
    from ..base import torch_environment
    from .registry import ModelError

    partial = {source: to.with_name(to.name + ".converting") for source, to in pairs.items()}
    try:
        for to in pairs.values():
            to.parent.mkdir(parents=True, exist_ok=True)
        request = json.dumps([[str(source), str(to)] for source, to in partial.items()])
        command = [torch_environment.python(), "-P", __file__, request]
        done = subprocess.run(command, capture_output=True, text=True, check=False,
                              env=torch_environment.apart_variables())  # fmt: skip
        told = done.stdout.strip().splitlines()
        try:
            reason = json.loads(told[-1]).get("error") if told else "memory ran out"
        except ValueError:
            reason = "nothing was said"
        if done.returncode or reason:
            raise ModelError(f"the weights cannot be converted: {reason or 'it was ended'}")
        for source, to in pairs.items():
            os.replace(partial[source], to)
    finally:
        for left in partial.values():
            left.unlink(missing_ok=True)


def take_tensors(source: Path, target: Path) -> None:
    """Pickle -> safetensors, here. Raises ValueError: one sentence, and what torch raises."""
    import torch
    from safetensors.torch import save_file

    release = tuple(int(n) for n in torch.__version__.split("+")[0].split(".")[:2])
    if release < SAFE_SINCE:
        raise ValueError(f"PyTorch {torch.__version__} reads pickles unsafely; 2.6 does not")
    found = torch.load(source, map_location="cpu", weights_only=True, mmap=True)
    if not isinstance(found, dict) or not found:
        raise ValueError("it is no table of tensors")
    tensors = {}
    for name, tensor in found.items():
        if not isinstance(name, str) or not isinstance(tensor, torch.Tensor) or tensor.is_sparse:
            raise ValueError(f"{name!r} in it is no tensor")
        tensors[name] = tensor.detach().clone()  # of its own memory: safetensors shares none
    save_file(tensors, str(target))


def main(pairs: list[list[str]]) -> None:
    """Converts each; says in one line what went wrong."""
    source = ""
    try:
        for source, target in pairs:
            take_tensors(Path(source), Path(target))
        told = {}
    except ValueError as error:
        told = {"error": f"{Path(source).name}: {error}"}
    except ImportError:
        told = {"error": "PyTorch and safetensors are needed"}
    except OSError as error:
        told = {"error": f"{Path(source).name}: {error.strerror or error}"}
    except Exception:  # whatever an odd file makes of the reader
        told = {"error": f"{Path(source).name} is damaged, or holds more than numbers"}
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
