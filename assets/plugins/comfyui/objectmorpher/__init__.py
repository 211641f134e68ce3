"""ComfyUI: nodes that select, lift, pose and render an object of a picture.

ObjectMorpher has to be installed in ComfyUI's own Python. On the wires are ComfyUI's IMAGE and
MASK, and OM_OBJECT: the edits of a batch of pictures, which later nodes go on with.
"""

import io
from pathlib import Path

import numpy as np

CATEGORY = "ObjectMorpher"
OBJECT = "OM_OBJECT"


def number(default=0.0, least=-1e5, most=1e5, step=1.0):
    """The widget of a number."""
    return "FLOAT", {"default": default, "min": least, "max": most, "step": step}


def edits_of(images):
    """An edit of each picture (B, H, W, 3) of a batch, in [0, 1]."""
    from PIL import Image

    import objectmorpher_core as om

    found = []
    for image in images:
        pixels = np.rint(np.clip(np.asarray(image)[..., :3], 0, 1) * 255).astype(np.uint8)
        out = io.BytesIO()
        Image.fromarray(pixels).save(out, "PNG")
        found.append(om.open(out.getvalue()))
    return found


def batch(arrays):
    """A tensor of ComfyUI's, float32, of arrays that are equally large."""
    import torch

    return torch.from_numpy(np.stack(arrays).astype(np.float32))


class Select:
    """Chooses an object by a click, or by a mask from another node."""

    CATEGORY, FUNCTION = CATEGORY, "select"
    RETURN_TYPES, RETURN_NAMES = (OBJECT, "MASK"), ("object", "mask")

    @classmethod
    def INPUT_TYPES(cls):  # ComfyUI's name for it
        return {
            "required": {"image": ("IMAGE",), "x": number(256.0), "y": number(256.0)},
            "optional": {"mask": ("MASK",)},
        }

    def select(self, image, x, y, mask=None):
        """`x`, `y`: px of the picture; a mask wins."""
        edits = edits_of(image)
        if mask is None:
            edits = [edit.click(x, y) for edit in edits]
        else:
            masks = np.asarray(mask) > 0.5
            edits = [edit.mask(masks[min(k, len(masks) - 1)]) for k, edit in enumerate(edits)]
        return edits, batch([edit.selection for edit in edits])


class Lift:
    """Gives the object a shape; what follows it in the graph does not do it again."""

    CATEGORY, FUNCTION = CATEGORY, "lift"
    RETURN_TYPES, RETURN_NAMES = (OBJECT,), ("object",)

    @classmethod
    def INPUT_TYPES(cls):  # ComfyUI's name for it
        return {"required": {"object": (OBJECT,), "thickness": number(1.0, 0.05, 3.0, 0.05)}}

    def lift(self, object, thickness):
        """`thickness`: times what the outline says."""
        return ([edit.lift(thickness=thickness) for edit in object],)


class Pose:
    """Drags a point of the object, or turns, moves and scales all of it."""

    CATEGORY, FUNCTION = CATEGORY, "pose"
    RETURN_TYPES, RETURN_NAMES = (OBJECT,), ("object",)

    @classmethod
    def INPUT_TYPES(cls):  # ComfyUI's name for it
        numbers = {name: number() for name in ("from_x", "from_y", "to_x", "to_y")}
        numbers |= {name: number(step=0.01) for name in ("farther",)}
        numbers |= {name: number(0.0, -180.0, 180.0) for name in ("yaw", "pitch", "roll")}
        numbers |= {"move_x": number(), "move_y": number(), "scale": number(1.0, 0.01, 100.0, 0.01)}
        return {"required": {"object": (OBJECT,), **numbers}}

    def pose(self, object, from_x, from_y, to_x, to_y, farther, yaw, pitch, roll, move_x, move_y,
             scale):  # fmt: skip
        """A drag that goes nowhere is none; angles are degrees, lengths px."""
        edits = []
        for edit in object:
            if (from_x, from_y) != (to_x, to_y) or farther:
                edit = edit.drag((from_x, from_y), (to_x, to_y), farther)
            if yaw or pitch or roll:
                edit = edit.turn(yaw, pitch, roll)
            if move_x or move_y:
                edit = edit.move(move_x, move_y)
            edits.append(edit if scale == 1.0 else edit.scale(scale))
        return (edits,)


class Render:
    """Puts the object back: the edited picture, where it is now, and what is behind it."""

    CATEGORY, FUNCTION = CATEGORY, "render"
    RETURN_TYPES, RETURN_NAMES = ("IMAGE", "MASK", "IMAGE"), ("image", "mask", "background")

    @classmethod
    def INPUT_TYPES(cls):  # ComfyUI's name for it
        return {"required": {"object": (OBJECT,)}}

    def render(self, object):
        """All three are as large as the picture."""
        from objectmorpher_core.pictures.image import read_picture

        pictures, masks, plates = [], [], []
        for edit in object:
            result = edit.plate().render()
            cut = read_picture(result.encode(".png", "object"))
            plate = read_picture(result.encode(".png", "plate"))
            pictures.append(result.pixels / 255)
            masks.append(cut.alpha / 255)
            plates.append(plate.pixels / 255)
        return batch(pictures), batch(masks), batch(plates)


class SaveSolid:
    """Writes the posed object as Gaussians (.ply, .spz, .splat) or as a mesh (.glb)."""

    CATEGORY, FUNCTION, OUTPUT_NODE = CATEGORY, "save", True
    RETURN_TYPES = ()

    @classmethod
    def INPUT_TYPES(cls):  # ComfyUI's name for it
        return {"required": {"object": (OBJECT,), "file": ("STRING", {"default": "object.ply"})}}

    def save(self, object, file):
        """The file of the first picture; the others have a number behind the name."""
        for k, edit in enumerate(object):
            path = Path(file) if k == 0 else Path(file).with_stem(f"{Path(file).stem}-{k}")
            what = "mesh" if path.suffix.lower() == ".glb" else "splats"
            edit.plate().render().save(path, what)
        return {}


NODE_CLASS_MAPPINGS = {f"ObjectMorpher{kind.__name__}": kind
                       for kind in (Select, Lift, Pose, Render, SaveSolid)}  # fmt: skip
NODE_DISPLAY_NAME_MAPPINGS = {
    "ObjectMorpherSelect": "Select object", "ObjectMorpherLift": "Lift object to 3D",
    "ObjectMorpherPose": "Pose object", "ObjectMorpherRender": "Render object",
    "ObjectMorpherSaveSolid": "Save object in 3D",
}  # fmt: skip
