"""The Place and Look tools by hand, in the real window under Xvfb."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hands import opened
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.view import ToolName
from objectmorpher.tools.gizmo import gizmo
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, LiftSettings, Prompt
from objectmorpher_core.pipeline import lift_mask, make_plate, open_photo
from objectmorpher_core.session.file import save_session
from tests.shadowed import inside, photo_of, thrown
from tests.shapes import png

pytestmark = [pytest.mark.window, pytest.mark.slow]

CANVAS = (48, 32, 1440 - 48 - 300, 900 - 32 - 28)  # x, y, width, height
PRIMARY = (1160, 839)  # in the primary button, left of its label
PLACE_TOOL = (10, 176)  # in the Place tool's button, beside its icon


def test_turning_by_a_ring_and_going_back(
    without_networks: dict[str, str], editor: Editor, ball: Document, tmp_path: Path
) -> None:
    session = tmp_path / "ball.omorph"
    save_session(ball, session)
    editor.start(ball)
    size, scale = (editor.view.width, editor.view.height), editor.view.scale
    editor.view.resize((CANVAS[2], CANVAS[3]), 1.0, editor.photo_size)
    editor.view.tool = ToolName.PLACE
    shown = gizmo(editor)
    assert shown is not None
    ring = shown.rings["roll"].seen(np.radians([200.0, 260.0])) + CANVAS[:2]
    editor.view.resize(size, scale, editor.photo_size)
    with opened(without_networks, session) as hands:
        middle = (CANVAS[0] + 30, CANVAS[1] + 30)
        hands.xdotool("mousemove", *middle)
        hands.press("4")
        hands.wait(lambda: hands.is_accent(PLACE_TOOL), "choosing the tool")
        long, short = hands.area("From above"), hands.area("Yaw")
        assert long[0] > short[0] and long[2] == short[2]  # the name does not run under its field
        hands.drag(tuple(ring[0]), tuple(ring[1]))
        hands.wait(lambda: hands.is_accent(PRIMARY), "turning")
        hands.wait(lambda: "edited" in hands.title(), "turning")
        hands.press("ctrl+z")
        hands.wait(lambda: "edited" not in hands.title(), "going back")
        assert not hands.is_accent(PRIMARY)


def test_a_shadow_that_is_offered_is_outlined_with_every_tool(
    without_networks: dict[str, str], tmp_path: Path
) -> None:
    pixels, session = photo_of(thrown(35.0, 0.8)), tmp_path / "thing.omorph"
    document = open_photo(png(pixels), "thing.png")
    document = edits.set_mask(edits.add_object(document), 0, inside(), Prompt())
    made = lift_mask(pixels, document.photo.camera, inside(), "relief", LiftSettings(800, trust=0))
    document = edits.set_lifted(document, 0, *made)
    save_session(
        edits.set_plate(document, make_plate(pixels, plate_cover(document), "telea")), session
    )
    with opened(without_networks, session) as hands:
        hands.press("4")
        hands.press("Shift+Left")
        hands.area("Take it along")
        for tool in ("1", "2", "3", "4", "6"):
            hands.press(tool)
            hands.settle()
            hands.area("Take it along")
            hands.area("Offered shadow")
        hands.press("Escape")
        hands.wait(lambda: "Offered shadow" not in hands.places(), "refusing it")
