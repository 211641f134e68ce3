"""Tiny SAMs: networks of random weights in the real classes, and ONNX files that tell colours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

SIDE = 64  # px that the tiny networks see
LARGE, STEP = 1024, 16  # px that a SAM of pixels sees, and of them for one of its embedding
COLOUR = 0.12  # distance of RGB in [0, 1] within which a colour is the clicked one
FAMILIES = ("sam", "sam2", "sam3")


def tiny(family: str, seed: int = 0) -> Any:
    """A network of a family with random weights."""
    import torch

    torch.manual_seed(seed)
    network = {"sam": _sam, "sam2": _sam2, "sam3": _sam3}[family]()
    if family == "sam":  # its initial weights are so small that every picture looks the same
        with torch.no_grad():
            for weight in network.vision_encoder.parameters():
                if weight.ndim > 1:
                    torch.nn.init.normal_(weight, std=0.2)
    return network.eval()


def write(family: str, folder: Path, seed: int = 0) -> Path:
    """The folder with config.json and model.safetensors."""
    tiny(family, seed).save_pretrained(folder)
    return folder


def _sam() -> Any:
    from transformers import SamConfig, SamModel

    hidden = {"hidden_size": 32}
    config = SamConfig(
        vision_config={
            **hidden, "output_channels": 32, "num_hidden_layers": 2, "num_attention_heads": 2,
            "image_size": SIDE, "patch_size": 8, "window_size": 4, "global_attn_indexes": [1],
            "num_pos_feats": 16, "mlp_dim": 64, "initializer_range": 0.2,
        },
        prompt_encoder_config={
            **hidden, "image_size": SIDE, "patch_size": 8, "mask_input_channels": 8,
        },
        mask_decoder_config={
            **hidden, "mlp_dim": 64, "num_attention_heads": 2, "iou_head_hidden_dim": 32,
        },
    )  # fmt: skip
    return SamModel(config)


def _sam2() -> Any:
    from transformers import (
        Sam2Config,
        Sam2HieraDetConfig,
        Sam2MaskDecoderConfig,
        Sam2Model,
        Sam2PromptEncoderConfig,
        Sam2VisionConfig,
    )

    backbone = Sam2HieraDetConfig(
        hidden_size=12, image_size=[SIDE, SIDE], blocks_per_stage=[1, 1, 2, 1],
        embed_dim_per_stage=[12, 24, 48, 96], num_attention_heads_per_stage=[1, 1, 2, 2],
        window_size_per_stage=[4, 4, 4, 4], global_attention_blocks=[3],
        window_positional_embedding_background_size=[2, 2],
    )  # fmt: skip
    vision = Sam2VisionConfig(
        backbone_config=backbone, backbone_channel_list=[96, 48, 24, 12], fpn_hidden_size=32,
        backbone_feature_sizes=[[SIDE // n, SIDE // n] for n in (4, 8, 16)],
    )  # fmt: skip
    prompts = Sam2PromptEncoderConfig(
        hidden_size=32, image_size=SIDE, patch_size=16, mask_input_channels=8
    )
    decoder = Sam2MaskDecoderConfig(
        hidden_size=32, mlp_dim=64, num_attention_heads=2, iou_head_hidden_dim=32
    )
    return Sam2Model(
        Sam2Config(vision_config=vision, prompt_encoder_config=prompts, mask_decoder_config=decoder)
    )


def _sam3() -> Any:
    from transformers import Sam3TrackerConfig, Sam3TrackerModel
    from transformers.models.sam3.configuration_sam3 import Sam3VisionConfig, Sam3ViTConfig

    patch = 14
    side = 4 * patch
    vit = Sam3ViTConfig(
        hidden_size=32, intermediate_size=64, num_hidden_layers=2, num_attention_heads=2,
        image_size=side, patch_size=patch, window_size=2, global_attn_indexes=[1],
        pretrain_image_size=side,
    )  # fmt: skip
    vision = Sam3VisionConfig(
        backbone_config=vit, fpn_hidden_size=32,
        backbone_feature_sizes=[[16, 16], [8, 8], [4, 4]],
    )  # fmt: skip
    hidden = {"hidden_size": 32}
    config = Sam3TrackerConfig(
        vision_config=vision,
        prompt_encoder_config={
            **hidden, "image_size": side, "patch_size": patch, "mask_input_channels": 8,
        },
        mask_decoder_config={
            **hidden, "mlp_dim": 64, "num_attention_heads": 2, "iou_head_hidden_dim": 32,
        },
    )  # fmt: skip
    return Sam3TrackerModel(config)


def write_onnx(layout: str, folder: Path) -> Path:
    """An encoder and a decoder: a click means what has the clicked colour around it.

    `layout`: "sam" (padded, normalised), "pixels" (padded, (h, w, 3)) or "efficient" (stretched).
    The embedding is the picture, and a box means the colour of its middle. Three masks: colours
    nearer and nearer; their scores prefer the middle one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "tiny.encoder.onnx").write_bytes(_encoder(layout))
    (folder / "tiny.decoder.onnx").write_bytes(_decoder(layout))
    return folder


def _made(nodes: list[Any], inputs: list[Any], outputs: list[Any], constants: dict) -> bytes:
    from onnx import helper, numpy_helper

    tensors = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "tiny", inputs, outputs, tensors)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    return model.SerializeToString()


def _encoder(layout: str) -> bytes:
    """Colours in [0, 1], (1, 3, LOW, LOW)."""
    from onnx import TensorProto, helper

    from objectmorpher_core.segment.sam.view import DEVIATION, MEAN

    def node(kind: str, given: list[str], out: str, **more: Any) -> Any:
        return helper.make_node(kind, given, [out], **more)

    constants: dict[str, np.ndarray] = {}
    if layout == "pixels":
        constants |= {
            "scale": np.float32(255), "axes": np.array([0], np.int64),
            "square": np.array([1, 3, LARGE, LARGE], np.int64),
        }  # fmt: skip
        constants |= {"zero": np.zeros(4, np.int64)}
        nodes = [
            node("Div", ["image", "scale"], "a"), node("Transpose", ["a"], "b", perm=[2, 0, 1]),
            node("Unsqueeze", ["b", "axes"], "c"), node("Shape", ["c"], "shape"),
            node("Sub", ["square", "shape"], "rest"),
            node("Concat", ["zero", "rest"], "pads", axis=0),
            node("Pad", ["c", "pads"], "d"),
            node("AveragePool", ["d"], "image_embeddings", kernel_shape=[STEP, STEP],
                strides=[STEP, STEP]),
        ]  # fmt: skip
        shape: list[Any] = ["h", "w", 3]
    elif layout == "sam":
        constants |= {
            "deviation": DEVIATION[None, :, None, None],
            "mean": MEAN[None, :, None, None],
        }
        nodes = [
            node("Mul", ["image", "deviation"], "a"),
            node("Add", ["a", "mean"], "image_embeddings"),
        ]
        shape = [1, 3, SIDE, SIDE]
    else:
        nodes = [node("Identity", ["image"], "image_embeddings")]
        shape = [1, 3, SIDE, SIDE]
    value = helper.make_tensor_value_info
    inputs = [value("image", TensorProto.FLOAT, shape)]
    outputs = [value("image_embeddings", TensorProto.FLOAT, [1, 3, SIDE, SIDE])]
    return _made(nodes, inputs, outputs, constants)


def _decoder(layout: str) -> bytes:
    """Logits 1 - (distance to the nearest colour of a positive point) / tolerance."""
    from onnx import TensorProto, helper

    def node(kind: str, given: list[str], out: str, **more: Any) -> Any:
        return helper.make_node(kind, given, [out], **more)

    is_efficient, side = layout == "efficient", LARGE if layout == "pixels" else SIDE
    points, labels = (
        ("batched_point_coords", "batched_point_labels")
        if is_efficient
        else ("point_coords", "point_labels")
    )
    tolerances = np.array([0.5, 1.0, 2.0], np.float32) * COLOUR
    if not is_efficient:  # SAM's export gives the one mask of clear prompts first
        tolerances = np.insert(tolerances, 0, COLOUR)
    scores = np.array([0.7, 0.9, 0.8], np.float32)
    if not is_efficient:
        scores = np.insert(scores, 0, 0.95)
    constants = {
        "ways": np.array([1, -1, 1, 2], np.int64), "flat": np.array([1, -1, 1, 1], np.int64),
        "half": np.float32(0.5), "unit": np.float32(2 / side), "one": np.float32(1),
        "least": np.float32(0.5), "tolerances": tolerances[None, :, None, None],
        "picture": np.array([1, 3, 1, SIDE, SIDE], np.int64),
        "columns": np.array([1, 3, -1, 1, 1], np.int64), "many": np.float32(1e3),
        "axis": np.array([1], np.int64), "scores": scores[None], "most_ground": np.float32(1.5),
    }  # fmt: skip
    # Points with the labels 1 (object), 2 and 3 (a box's corners). A corner's colour means little,
    # so corners are moved to the middle between them: to the mean of both.
    nodes = [
        node("Reshape", [points, "ways"], "p"), node("Reshape", [labels, "flat"], "l"),
        node("Greater", ["l", "most_ground"], "is_corner_b"),
        node("Cast", ["is_corner_b"], "is_corner", to=TensorProto.FLOAT),
        node("Mul", ["p", "is_corner"], "corners"),
        node("ReduceSum", ["corners", "axis"], "corner_sum", keepdims=1),
        node("Mul", ["corner_sum", "half"], "middle"),
        node("Where", ["is_corner_b", "middle", "p"], "places"),
        node("Add", ["places", "half"], "centred"), node("Mul", ["centred", "unit"], "from_0"),
        node("Sub", ["from_0", "one"], "grid"),
        node("GridSample", ["image_embeddings", "grid"], "colours", align_corners=0),
        node("Reshape", ["colours", "columns"], "each"),
        node("Reshape", ["image_embeddings", "picture"], "pixels"),
        node("Sub", ["pixels", "each"], "difference"),
        node("ReduceL2", ["difference"], "distance", axes=[1], keepdims=0),
        node("Less", ["l", "least"], "is_none_b"),
        node("Cast", ["is_none_b"], "is_none", to=TensorProto.FLOAT),
        node("Mul", ["is_none", "many"], "far"), node("Add", ["distance", "far"], "told"),
        node("ReduceMin", ["told"], "nearest", axes=[1], keepdims=1),
        node("Div", ["nearest", "tolerances"], "relative"),
        node("Sub", ["one", "relative"], "logits"),
    ]  # fmt: skip
    value, real = helper.make_tensor_value_info, TensorProto.FLOAT
    count = len(scores)
    if is_efficient:
        inputs = [
            value("image_embeddings", real, [1, 3, SIDE, SIDE]),
            value(points, real, [1, 1, "n", 2]), value(labels, real, [1, 1, "n"]),
            value("orig_im_size", TensorProto.INT64, [2]),
        ]  # fmt: skip
        constants["shaped"] = np.array([1, 1, count, SIDE, SIDE], np.int64)
        constants["scored"] = np.array([1, 1, count], np.int64)
        nodes += [
            node("Reshape", ["logits", "shaped"], "output_masks"),
            node("Reshape", ["scores", "scored"], "iou_predictions"),
        ]
        outputs = [
            value("output_masks", real, [1, 1, count, SIDE, SIDE]),
            value("iou_predictions", real, [1, 1, count]),
        ]
    else:
        inputs = [
            value("image_embeddings", real, [1, 3, SIDE, SIDE]),
            value(points, real, [1, "n", 2]), value(labels, real, [1, "n"]),
            value("mask_input", real, [1, 1, SIDE, SIDE]), value("has_mask_input", real, [1]),
            value("orig_im_size", real, [2]),
        ]  # fmt: skip
        nodes += [
            node("Identity", ["logits"], "low_res_masks"), node("Identity", ["logits"], "masks"),
            node("Identity", ["scores"], "iou_predictions"),
        ]  # fmt: skip
        outputs = [
            value("masks", real, [1, count, SIDE, SIDE]),
            value("iou_predictions", real, [1, count]),
            value("low_res_masks", real, [1, count, SIDE, SIDE]),
        ]  # fmt: skip
    return _made(nodes, inputs, outputs, constants)
