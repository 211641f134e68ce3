"""ONNX files that select, fill or see depth: opened, and refused where they take something else.

What a file takes says which export it is. It is looked at where the user brings a file, in
`models verify`, and before it is used; a picture is shown only to depth networks.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .onnx_session import open_session
from .registry import ModelError
from .weight_folder import GRAPH, ONE_GRAPH, ONNX

FILLERS = {"lama": "LaMa", "migan": "MI-GAN"}  # family -> name for people
SAM = {"point_coords", "point_labels", "mask_input"}  # inputs of a decoder as SAM exports it
EFFICIENT = {"batched_point_coords", "batched_point_labels"}  # of EfficientSAM's
SCORES = "iou_predictions"  # an output that both have


def check_graphs(family: str, at: Path, names: Sequence[str]) -> None:
    """Raises ModelError where ONNX files in a folder are no model of `family`. Costly.

    Models of other kinds of files pass.
    """
    graphs = [at / name for name in names if name.endswith(GRAPH)]
    if family in FILLERS:
        filler_inputs(opened(graphs[0]), graphs[0].name, family)
    elif family.endswith(ONNX):
        encoder, decoder = graphs
        sam_inputs(opened(encoder), opened(decoder), (encoder.name, decoder.name))
    elif family in ONE_GRAPH:
        from .depth_net import DepthNet

        DepthNet(graphs[0]).check()


def opened(path: Path) -> Any:
    """An onnxruntime session. Costly. Raises ModelError where the file is no ONNX network."""
    try:
        return open_session(path, is_foreign=True)
    except Exception as error:  # onnxruntime has a type of its own for everything
        raise ModelError(f"{path.name} is not an ONNX network that can be opened") from error


def filler_inputs(session: Any, file: str, family: str) -> dict[int, Any]:
    """The inputs of a network of `FILLERS` by their channels: 3 and 1, or 4. Raises ModelError."""
    inputs: dict[Any, Any] = {len(i.shape) == 4 and i.shape[1]: i for i in session.get_inputs()}
    if not ({3, 1} == inputs.keys() or {4} == inputs.keys()):
        given = [f"{i.name} {i.shape}" for i in session.get_inputs()]
        raise ModelError(f"{file} takes {', '.join(given)}: no known {FILLERS[family]}")
    if len(set(fixed := fixed_sides(inputs))) > 1:
        raise ModelError(f"{file} sees {fixed[1]} x {fixed[0]} px, not a square")
    return inputs


def fixed_sides(inputs: dict[int, Any]) -> list[int]:
    """Px, height and width of the picture among `filler_inputs`, as far as the file says them."""
    picture = inputs.get(3) or inputs[4]
    return [n for n in picture.shape[2:] if isinstance(n, int) and n > 0]


def sam_inputs(encoder: Any, decoder: Any, files: tuple[str, str]) -> tuple[Any, dict[str, Any]]:
    """The encoder's input and the decoder's by their names. Raises ModelError.

    `files`: the names of both.
    """
    pictures, inputs = encoder.get_inputs(), {i.name: i for i in decoder.get_inputs()}
    if not pictures or len(pictures[0].shape) not in (3, 4):
        given = [f"{i.name} {i.shape}" for i in pictures]
        raise ModelError(f"{files[0]} takes {', '.join(given)}: no picture")
    if not (inputs.keys() >= SAM or inputs.keys() >= EFFICIENT):
        raise ModelError(f"{files[1]} takes {', '.join(inputs)}: not a known layout")
    outputs = [output.name for output in decoder.get_outputs()]
    if SCORES not in outputs:
        raise ModelError(f"{files[1]} gives {', '.join(outputs)}, and no {SCORES}")
    return pictures[0], inputs
