"""Folders of subjects, DragBench's and GeoBench's among them, and logs of what methods took."""

from __future__ import annotations

import json
import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core.pictures.image import Picture, encode_mask, encode_picture
from objectmorpher_core.scripting.options import FINISH, EditScript, options_of
from objectmorpher_core.scripting.script import beside, read_scripts
from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.paper import table
from objectmorpher_research.evaluation.paper.interaction_log import (
    Event,
    encode_events,
    of_events,
    read_frames,
    read_recorded,
)
from objectmorpher_research.evaluation.paper.table import COLUMNS, NOTHING, measure_paper
from objectmorpher_research.evaluation.subjects.folders import read_subjects
from objectmorpher_research.evaluation.subjects.guidance import words_of
from objectmorpher_research.evaluation.subjects.subject import methods_of

SIDE = 64


def save(path: Path, rgb: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encode_picture(Picture(np.ascontiguousarray(rgb)), ".png"))
    return path


@pytest.fixture
def small(coffee) -> np.ndarray:
    return coffee[100 : 100 + SIDE, 200 : 200 + SIDE]


@pytest.fixture
def own(tmp_path, small) -> Path:
    """Two subjects in our layout, with a method's results."""
    for name in ("cup", "spoon"):
        save(tmp_path / name / "image.png", small)
        save(tmp_path / name / "results" / "faint.png", small // 2)
        script = {"click": [[5, 6]], "move": [3, 4], "mask": "m.png"} if name == "cup" else {}
        (tmp_path / name / "guidance.json").write_text(json.dumps(script))
    mask = np.zeros((SIDE, SIDE), bool)
    mask[10:20, 30:50] = True
    (tmp_path / "cup" / "m.png").write_bytes(encode_mask(mask))
    (tmp_path / "notes").mkdir()
    return tmp_path


@pytest.fixture
def drag(tmp_path, small) -> Path:
    """Two samples as DragBench has them."""
    for name, points in (("animals/JH_1", [[1, 2], [30, 4]]), ("art/x", [(5, 6), (7, 8)] * 2)):
        save(tmp_path / name / "original_image.png", small)
        meta = {"prompt": "a", "points": points, "mask": np.zeros((SIDE, SIDE), np.uint8)}
        (tmp_path / name / "meta_data.pkl").write_bytes(pickle.dumps(meta))
    return tmp_path


def geo(folder: Path, small: np.ndarray, **edits: list[float]) -> Path:
    """A photo and its edits as GeoBench has them, with the paths of another disk."""
    save(folder / "source_img" / "455.png", small)
    mask = np.zeros((SIDE, SIDE), bool)
    mask[8:24, 8:40] = True
    path = folder / "source_mask" / "455" / "0.png"
    path.parent.mkdir(parents=True)
    path.write_bytes(encode_mask(mask))
    told = {
        name: {
            "edit_prompt": f"Edit {name}", "edit_param": numbers, "obj_label": "bottle",
            "ori_img_path": "/data/someone/Geo-Bench/source_img/455.png",
            "ori_mask_path": "/data/someone/Geo-Bench/source_mask/455/0.png",
        }
        for name, numbers in edits.items()
    }  # fmt: skip
    (folder / "annotations.json").write_text(json.dumps({"455": {"instances": {"0": told}}}))
    return folder


def test_our_own_folders(own):
    cup, spoon = read_subjects(own)
    assert (cup.name, spoon.name) == ("cup", "spoon")
    assert methods_of((cup, spoon)) == ("faint",)
    assert cup.guidance.item is not None
    assert Path(cup.guidance.item.script.mask or "") == own / "cup" / "m.png"
    assert cup.guidance.arrows == (((40, 15), (43, 19)),)  # from the mask's middle
    assert cup.guidance.words == "Move the object along the arrow."
    assert not spoon.guidance.is_shown


def test_results_in_a_folder_of_each_method(drag, tmp_path_factory, small):
    results = tmp_path_factory.mktemp("results")
    save(results / "animals" / "JH_1" / "dragged_image.png", small)
    (results / "animals" / "JH_1" / "dragged_image.jsonl").write_bytes(
        encode_events([Event(0, "begin", "x"), Event(2, "end", "x")])
    )
    save(results / "art" / "x.png", small)
    first, second = read_subjects(drag, {"theirs": results})
    assert first.results["theirs"].log is not None and second.results["theirs"].log is None
    with pytest.raises(EvaluationError, match="holds no result of any of the 2"):
        read_subjects(drag, {"theirs": results / "art"})


def test_dragbench(drag):
    first, second = read_subjects(drag)
    assert first.name == "animals/JH_1"
    assert first.guidance.arrows == (((1, 2), (30, 4)),)
    assert len(second.guidance.arrows) == 2
    assert first.guidance.item is not None
    assert first.guidance.item.script.click == ((1, 2),)


@pytest.mark.parametrize(
    ("meta", "told"),
    [
        ({"points": [[1, 2]]}, "1 points"),
        ({"points": [[1, 2], [3]]}, "points are none"),
        ({"points": [[1, 2], [3, math.nan]]}, "points are none"),
        ({"points": [[1, 2], [3, 10**400]]}, "points are none"),
        ({"points": 7}, "points are none"),
        ({}, "0 points"),
        ([1], "no table"),
        (Path("."), "more than plain values"),
    ],
)
def test_dragbench_that_is_damaged(drag, meta, told):
    (drag / "art" / "x" / "meta_data.pkl").write_bytes(pickle.dumps(meta))
    with pytest.raises(EvaluationError, match=told):
        read_subjects(drag)


def test_geobench(tmp_path, small):
    same = [0, 0, 0, 0, 0, 0, 1, 1, 1]
    folder = geo(
        tmp_path, small,
        move=[64, -128, *same[2:]], turn=[*same[:5], 30, 1, 1, 1], size=[*same[:6], 0.5, 0.5, 1],
        deep=[*same[:4], 40, 0, 1, 1, 1], wide=[*same[:6], 2, 1, 1],
    )  # fmt: skip
    found = {subject.name: subject.guidance for subject in read_subjects(folder)}
    scripts = {name[6:]: g.item.script for name, g in found.items() if g.item is not None}
    assert scripts["move"].move == (8, -16, 0)  # px of a photo of 64 px, told in those of 512
    assert scripts["turn"].turn == (0, 0, 30)
    assert scripts["size"].scale == 0.5
    assert found["455/0/move"].arrows == (((24, 16), (32, 0)),)
    assert found["455/0/turn"].words == "Edit turn"
    assert "signs are not published" in found["455/0/deep"].reason
    assert "stretches" in found["455/0/wide"].reason


def test_a_positive_turn_of_geobench_is_clockwise_as_ours_is():
    """Both turn x towards y, which points down: `--turn` 0,0,90 takes right to down."""
    from objectmorpher_core.base.rotations import turn_matrix

    assert np.allclose(turn_matrix(0, 0, 90) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"ori_img_path": "/elsewhere/455.jpg"}, "has not the file"),
        ({"ori_img_path": "../../etc/passwd"}, "has not the file"),
        ({"ori_img_path": None}, "has not the file"),
        ({"edit_param": [1, 2]}, "not 9 numbers"),
        ({"edit_param": ["a"] * 9}, "not 9 numbers"),
        ({"edit_param": None}, "not 9 numbers"),
    ],
)
def test_geobench_that_is_damaged(tmp_path, small, change, told):
    folder = geo(tmp_path, small, move=[1, 1, 0, 0, 0, 0, 1, 1, 1])
    path = folder / "annotations.json"
    data = json.loads(path.read_text())
    data["455"]["instances"]["0"]["move"] |= change
    path.write_text(json.dumps(data))
    with pytest.raises(EvaluationError, match=told):
        read_subjects(folder)


def test_paths_of_annotations_do_not_lead_out_of_the_folder(tmp_path, small):
    save(tmp_path / "secret.png", small)
    folder = geo(tmp_path / "set", small, move=[1, 1, 0, 0, 0, 0, 1, 1, 1])
    path = folder / "annotations.json"
    data = json.loads(path.read_text())
    for named in (str(tmp_path / "secret.png"), "../secret.png", "x/../../secret.png"):
        data["455"]["instances"]["0"]["move"]["ori_img_path"] = named
        path.write_text(json.dumps(data))
        with pytest.raises(EvaluationError, match="has not the file"):
            read_subjects(folder)


@pytest.mark.parametrize(
    ("script", "told"),
    [
        ({"move": (10, -4, 0)}, "Move the object 10 px to the right and 4 px up."),
        ({"turn": (20, 0, -5)},
         "Turn it by 20° so that its front goes left and by 5° anticlockwise."),
        ({"scale": 0.5, "move": (0, 0, 2)},
         "Move the object 2 diameters away, scale it to 50% of its size."),
        ({"spin": 30}, "Turn it where it stands by 30° so that its front goes left."),
        ({"exposure": -1, "opacity": 0.4}, "Make it 40% opaque, make it 1 stop darker."),
        ({"warmth": 0.3, "saturation": 0},
         "Make its colours 30% warmer, make its colours 100% weaker."),
        ({"remove": True}, "Remove the object."),
        ({}, ""),
    ],
)  # fmt: skip
def test_guidance_in_words(script, told):
    assert words_of(EditScript(**script)) == told


ASKED = {
    "move": (10, -4, 0), "turn": (20, 0, 0), "spin": 30, "scale": 2, "opacity": 0.5,
    "exposure": -1.5, "warmth": 0.2, "saturation": 1.5, "sharpness": 2, "blur": 3,
    "blend_mode": "multiply",
}  # fmt: skip


def test_words_leave_out_nothing_of_how_a_thing_is_placed_and_finished():
    assert options_of(FINISH) <= ASKED.keys()
    every = words_of(EditScript(**ASKED)).lower()
    for name, value in ASKED.items():
        alone = words_of(EditScript(**{name: value})).lower().removesuffix(".")
        assert alone and alone in every, name


def test_a_copy_is_asked_for(own):
    further = [{"duplicate": 1, "move": [-50, 0]}, {"duplicate": 1}]
    script = {"mask": "m.png", "scale": 2, "objects": further}
    (own / "cup" / "guidance.json").write_text(json.dumps(script))
    cup, _ = read_subjects(own)
    assert cup.guidance.words == (
        "Scale it to 200% of its size. Add a copy of the object. Move the copy 50 px to the left."
        " Add a copy of the object."
    )


def test_files_of_guidance_lie_beside_it_as_those_of_a_script_do(own):
    script = {"mask": "m.png", "hidden": "h.png", "more_views": [{"photo": "side.jpg"}]}
    path = own / "cup" / "guidance.json"
    path.write_text(json.dumps(script))
    cup, _ = read_subjects(own)
    (item,) = read_scripts(path)
    assert cup.guidance.item == beside(item, path.parent)


def test_an_input_waits_for_the_next_feedback():
    found = of_events([
        Event(0, "input"), Event(0.5, "input"), Event(1, "feedback"), Event(2, "input"),
        Event(2.25, "feedback"), Event(3, "feedback"),
    ])  # fmt: skip
    assert found.latencies == (1, 0.5, 0.25)
    assert found.latency == 1 and found.computing is None
    never = of_events([Event(0, "input"), Event(1, "feedback"), Event(2, "input")])
    assert never.latency == math.inf


def test_time_counts_once_however_many_stages_run_in_it():
    found = of_events([
        Event(0, "begin", "whole"), Event(1, "begin", "lift"), Event(2, "end", "lift"),
        Event(4, "end", "whole"), Event(6, "begin", "lift"), Event(7, "end", "lift"),
    ])  # fmt: skip
    assert found.computing == 5 and found.latency is None


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("", "empty"), ("[1]", "line 1 is not"), ('{"t": 1}', "line 1 is not"),
        ('{"t": "1", "event": "input"}', "no time"), ('{"t": NaN, "event": "input"}', "no time"),
        ('{"t": 1, "event": "typed"}', "no event"),
        ('{"t": 2, "event": "input"}\n\n{"t": 1, "event": "input"}', "line 3 is before"),
        ('{"t": 2, "event": "begin", "what": "x"}', "does not end"),
        ('{"t": 2, "event": "end", "what": "x"}', "ends before"),
    ],
)  # fmt: skip
def test_logs_that_are_none(tmp_path, lines, told):
    path = tmp_path / "m.jsonl"
    path.write_text(lines)
    with pytest.raises(EvaluationError, match=told):
        read_recorded(path)


def test_our_report_tells_the_computing(tmp_path):
    path = tmp_path / "m.json"
    seconds = dict.fromkeys(("segment", "lift", "graph", "deform", "inpaint", "render"), 0.5)
    path.write_text(json.dumps({"seconds": {**seconds, "refine": 2, "load": 9, "save": 9}}))
    found = read_recorded(path)
    assert found.computing == 5 and found.latency is None
    path.write_text('{"seconds": {"lift": 1}}')
    with pytest.raises(EvaluationError, match="no report"):
        read_recorded(path)


def frame(began: float, shown: float, x: float, is_stroke: bool = True) -> dict:
    return {"began": began, "shown": shown, "x": x, "y": 0, "is_stroke": is_stroke, "job": ""}


def test_the_window_s_frames_tell_how_soon_a_drag_is_seen(tmp_path):
    path = tmp_path / "m.frames.json"
    frames = [
        frame(0, 0.01, 1, False), frame(1, 1.02, 2), frame(2, 2.5, 2), frame(3, 3.01, 5),
        frame(4, 4.01, 9, False),
    ]  # fmt: skip
    path.write_text(json.dumps(frames))
    assert read_frames(path) == (1.02, pytest.approx(1.01))
    for text in ("", "{}", "[1]", '[{"began": 1}]', json.dumps([frame(0, math.nan, 1)])):
        path.write_text(text)
        if text != "{}":
            with pytest.raises(EvaluationError, match="no frame log"):
                read_frames(path)


@pytest.mark.parametrize("ending", [".png", ".jxl", ".avif"])
def test_results_of_another_shape_than_the_photo_are_named_whatever_its_format(
    tmp_path, coffee, ending
):
    photo = np.ascontiguousarray(coffee[:40, :60])
    folder = tmp_path / "cup"
    for name, pixels in (("same", photo), ("turned", np.rot90(photo)), ("half", photo[::2, ::2])):
        save(folder / "results" / f"{name}.png", pixels)
    (folder / f"image{ending}").write_bytes(encode_picture(Picture(photo), ending))
    assert set(table._resized(read_subjects(tmp_path))) == {"turned: cup", "half: cup"}


def test_the_paper_s_table(own, small, monkeypatch):
    """Nothing done is the best of all by every measure; what cannot be taken is named."""
    from objectmorpher_research.evaluation.measures import dino

    if dino.missing():
        pytest.skip(dino.missing() or "")
    save(own / "cup" / "results" / "half.png", small[::2, ::2])
    (own / "cup" / "results" / "half.jsonl").write_text(
        '{"t": 0, "event": "begin", "what": "all"}\n{"t": 3, "event": "end", "what": "all"}\n'
    )
    frames = [frame(0, 0.01, 1), frame(0.02, 0.03, 2), frame(0.04, 0.05, 3)]
    (own / "cup" / "results" / "half.frames.json").write_text(json.dumps(frames))
    found = measure_paper(read_subjects(own))
    rows = {row.method: row for row in found.rows}
    assert set(rows) == {NOTHING, "faint", "half"}
    assert rows[NOTHING].scores["DINO-identity"].value == pytest.approx(1)
    assert rows["faint"].scores["DINO-perceptual"].value > 0.001
    assert rows["half"].subjects == ("cup",) and found.resized == ("half: cup",)
    assert rows["half"].computing is not None and rows["half"].computing.value == 3
    assert rows["half"].latency is not None
    assert rows["half"].latency.value == pytest.approx(0.03)
    assert rows["faint"].computing is None and rows["faint"].latency is None
    absent = {left.metric for left in found.lacking}
    assert {COLUMNS[c] for c in ("LPIPS", "SIFID", "KID")} <= absent
