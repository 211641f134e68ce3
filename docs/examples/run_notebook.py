"""Run the notebook beside this script, and keep what its cells show in it.

A notebook's cells are plain Python, so that neither Jupyter nor a kernel is needed for it.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

HERE = Path(__file__).parent
NOTEBOOK = HERE / "first_edit.ipynb"
LONGEST, QUALITY = 480, 80  # of a picture that is kept: px, of JPEG


def outputs(notebook: dict[str, Any]) -> Iterator[tuple[dict[str, Any], list[dict[str, Any]]]]:
    """Run the cells in the current folder; each code cell, and what it prints and shows."""
    names: dict[str, Any] = {"__name__": "__main__"}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            yield cell, _run("".join(cell["source"]), names)


def _run(source: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    said, value = io.StringIO(), None
    with contextlib.redirect_stdout(said):
        exec(compile(tree, NOTEBOOK.name, "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names)
    found: list[dict[str, Any]] = []
    if text := said.getvalue():
        found.append({"output_type": "stream", "name": "stdout", "text": text.splitlines(True)})
    if value is not None:
        found.append({"output_type": "display_data", "metadata": {}, "data": _shown(value)})
    return found


def _shown(value: Any) -> dict[str, Any]:
    data: dict[str, Any] = {"text/plain": [re.sub(r" at 0x\w+", "", repr(value))]}
    if hasattr(value, "_repr_png_"):
        image = Image.open(io.BytesIO(value._repr_png_())).convert("RGBA")
        image = Image.alpha_composite(Image.new("RGBA", image.size, "white"), image).convert("RGB")
        image.thumbnail((LONGEST, LONGEST))
        out = io.BytesIO()
        image.save(out, "JPEG", quality=QUALITY)
        data["image/jpeg"] = base64.b64encode(out.getvalue()).decode()
    return data


def main() -> None:
    """Run the notebook in a folder of its own, and write it again with its outputs."""
    notebook = json.loads(NOTEBOOK.read_text("utf-8"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "docs" / "examples"
        folder.mkdir(parents=True)
        (Path(name) / "assets").symlink_to(HERE.parents[1] / "assets")
        os.chdir(folder)
        for cell, shown in outputs(notebook):
            cell["outputs"] = shown
        os.chdir(HERE)
    NOTEBOOK.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")


if __name__ == "__main__":
    main()
