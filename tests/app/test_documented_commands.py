"""Every edit that the README and the how-to pages show is run, on the photos that it names."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from objectmorpher.cli import parser as cli
from objectmorpher_core import pipeline
from objectmorpher_core.pictures.image import read_picture
from objectmorpher_core.scripting.animation import Clip
from tests.core.lift.registered import two_sides
from tests.photos import outlined

pytestmark = pytest.mark.usefixtures("lifted_once", "filled_once")

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "howto").glob("*.md"))]
RUN = ("edit", "select", "replay", "convert", "batch", "share")
# A shadow that goes along, and a turn that shows much of what is invented.
EXPECTED = re.compile(r"goes along with it|is removed|is guesswork|look closely")
PICTURES = 10  # of each film, in place of 25 a second
TWO = {
    "photo": "flower.jpg", "click": [[300, 190]], "move": [-60, 0],
    "objects": [{"click": [[90, 330]], "remove": True}],
}  # fmt: skip


def _shown() -> list[str]:
    """The commands, in the order in which they stand on the pages, each once."""
    found: dict[str, None] = {}
    for page in PAGES:
        for block in re.findall(r"^```\w*\n(.*?)^```", page.read_text("utf-8"), re.M | re.S):
            for line in re.sub(r"\\\n\s*", "", block).splitlines():
                words = line.split()
                if words[:1] == ["objectmorpher"] and words[1] in RUN and "--ray" not in words:
                    found[re.sub(r"\s+#.*", "", line)] = None
    return list(found)


def _laid_out(folder: Path) -> None:
    """All that the pages name: the samples, and stand-ins for what a user brings."""
    for sample in (ROOT / "assets" / "samples").glob("*.jpg"):
        shutil.copy(sample, folder)
    cv2.imwrite(str(folder / "shuttle.png"), outlined("shuttle").astype(np.uint8) * 255)
    ball = trimesh.creation.icosphere(3, vertex_colors=[200, 160, 40, 255])
    for name in ("duck.glb", "model.obj"):
        ball.export(folder / name)
    y, x = np.mgrid[:240, :320]
    round_ = np.hypot(x - 160, y - 120) < 70
    grey = 110 + (x - y) / 8 + 4 * np.random.default_rng(0).normal(size=x.shape)
    yellow = np.clip(1.2 - np.hypot(x - 140, y - 95) / 130, 0.2, 1)[..., None] * (50, 170, 220)
    duck = np.where(round_[..., None], yellow, np.repeat(grey[..., None], 3, 2))
    cv2.imwrite(str(folder / "duck.jpg"), duck.clip(0, 255).astype(np.uint8))
    for scene, name in zip(two_sides(), ("front.jpg", "side.jpg"), strict=True):
        cv2.imwrite(str(folder / name), scene.pixels[..., ::-1])
    (folder / "two-flowers.json").write_text(json.dumps(TWO))
    many = (ROOT / "docs" / "howto" / "many.md").read_text("utf-8")
    script = re.search(r"```json\n(.*?)```", many, re.S)
    assert script is not None
    (folder / "edit.json").write_text(script[1])
    for part in ("scripts", "photos", "edited"):
        (folder / part).mkdir()
    (folder / "scripts" / "turn.json").write_text('{"click": [[310, 240]], "turn": [20, 0, 0]}')
    shutil.copy(folder / "coffee.jpg", folder / "photos")


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
def test_every_command_that_is_shown_runs_and_changes_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    _laid_out(tmp_path)
    read = pipeline.read_photo
    kept: dict[tuple[bytes, str], pipeline.Reading] = {}

    def once(pixels, segmenter, progress):
        """Each photo is read by the network once, not by every command."""
        key = pixels.tobytes(), segmenter.name
        if key not in kept:
            kept[key] = read(pixels, segmenter, progress)
        return kept[key]

    monkeypatch.setattr(pipeline, "read_photo", once)
    # The films' length is not what the pages show: `test_animation.py` looks at that.
    monkeypatch.setattr(Clip, "count", PICTURES)
    shown = _shown()
    assert len(shown) >= 16
    for number, line in enumerate(shown):
        words = shlex.split(line)[1:]
        if "scan.ply" in words:  # what an earlier command has saved is a scan as good as any
            shutil.copy("object.ply", "scan.ply") if Path("object.ply").exists() else _scan()
        before = _written(tmp_path)
        assert cli.main(words) == 0, f"{line}: {capsys.readouterr().err}"
        for told in capsys.readouterr().err.splitlines():
            assert EXPECTED.search(told), f"{line}: {told}"
        assert _written(tmp_path) != before, line
        if words[0] == "edit" and "-o" in words:
            _check_edit(words, tmp_path, number)


def _written(folder: Path) -> dict[Path, int]:
    """When each file was written last, ns."""
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


def _scan() -> None:
    """A splat file."""
    assert cli.main(["convert", "model.obj", "scan.ply"]) == 0


def _check_edit(words: list[str], folder: Path, number: int) -> None:
    """The picture has the photo's size, and is changed, but not all of it."""
    out = folder / words[words.index("-o") + 1]
    edited = read_picture(out.read_bytes()).pixels
    if words[1].startswith("--"):
        return
    photo = read_picture((folder / words[1]).read_bytes()).pixels
    assert edited.shape == photo.shape, words
    share = float((edited != photo).any(-1).mean())
    assert 0.005 < share < 0.8, (words, share)
    out.replace(folder / f"{number:02d}-{out.name}")
