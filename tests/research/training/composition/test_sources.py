"""Pairs are found in every layout, and each picture is read from where it is."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import cv2
import numpy as np
import pytest
from skimage import data

from objectmorpher_core.pictures.video import VideoError, encode_video, frame_rate, read_frames
from objectmorpher_research.training.composition import TrainingError
from objectmorpher_research.training.composition.pictures import PictureSource, halved
from objectmorpher_research.training.composition.sources import (
    SourcePair,
    SourceReading,
    find_pairs,
    fingerprint,
    pair_from,
)
from tests import shapes

ONE_WAY = SourceReading(both_ways=False)
SIDE = 64
EDGE = 1  # px, 8 / 528 of the height
GOOD = {"compositeStructure": 5, "objectConsistency": 5, "imageQuality": 5}


def two_halves(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As Subjects200K has them: 512 px each with 8 px around and 16 between; here an eighth."""
    rng = np.random.default_rng(seed)
    left, right = rng.integers(0, 255, (2, SIDE, SIDE, 3), np.uint8)
    whole = np.full((SIDE + 2 * EDGE, 2 * SIDE + 4 * EDGE, 3), 255, np.uint8)
    whole[EDGE : EDGE + SIDE, EDGE : EDGE + SIDE] = left
    whole[EDGE : EDGE + SIDE, SIDE + 2 * EDGE : 2 * SIDE + 2 * EDGE] = right
    return whole, left, right


def write(at, pixels) -> None:
    at.parent.mkdir(parents=True, exist_ok=True)
    at.write_bytes(shapes.png(pixels))


def test_halves_are_cut_where_they_are():
    whole, left, right = two_halves()
    assert np.array_equal(halved(whole, "left", EDGE / len(whole)), left)
    assert np.array_equal(halved(whole, "right", EDGE / len(whole)), right)
    plain = np.hstack([left, right])
    assert np.array_equal(halved(plain, "left", 0), left)
    assert np.array_equal(halved(plain, "right", 0), right)
    assert halved(whole, "", 0.1) is whole
    with pytest.raises(TrainingError, match="not two pictures side by side"):
        halved(left[:, :40], "right", EDGE / len(whole))
    full = np.zeros((528, 1056, 3), np.uint8)  # the published size
    full[8:520, 8:520] = 1
    full[8:520, 528:1040] = 2
    assert halved(full, "left", 8 / 528).min() == 1 and halved(full, "right", 8 / 528).min() == 2


@pytest.mark.parametrize("layout", ["jsonl", "each"])
def test_a_folder_of_subjects(tmp_path, layout):
    rows = [
        {"quality_assessment": GOOD, "description": {"item": "mug", "description_valid": True}},
        {"quality_assessment": GOOD | {"objectConsistency": 4}, "description": {"item": "shoe"}},
        {"quality_assessment": GOOD, "description": {"item": "hat", "description_valid": False}},
    ]
    for k, row in enumerate(rows):
        write(tmp_path / f"{k}.png", two_halves(k)[0])
        if layout == "each":
            (tmp_path / f"{k}.json").write_text(json.dumps(row))
        row["file_name"] = f"{k}.png"
    if layout == "jsonl":
        (tmp_path / "metadata.jsonl").write_text("\n".join(map(json.dumps, rows)))
    found = find_pairs(tmp_path, SourceReading(both_ways=False, padding=EDGE / (SIDE + 2 * EDGE)))
    assert [pair.item for pair in found] == ["mug", "shoe", "hat"]
    assert found[0].problem == "" and "objectConsistency below 5" in found[1].problem
    assert "description wrong" in found[2].problem
    _, left, right = two_halves(0)
    assert np.array_equal(found[0].b.read(), left) and np.array_equal(found[0].a.read(), right)


def test_a_table_of_subjects(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    wholes = [two_halves(k)[0] for k in range(5)]
    table = pyarrow.table(
        {
            "image": [{"bytes": shapes.png(w), "path": None} for w in wholes],
            "quality_assessment": [GOOD] * 4 + [None],
            "description": [{"item": f"thing {k}", "description_valid": True} for k in range(5)],
        }
    )
    parquet.write_table(table, tmp_path / "train-0.parquet", row_group_size=2)
    how = SourceReading(both_ways=True, padding=EDGE / (SIDE + 2 * EDGE))
    found = find_pairs(tmp_path, how)
    assert len(found) == 10 and found[0].item == "thing 0"
    for k in (0, 3, 4):  # of each group
        _, left, right = two_halves(k)
        pair, back = found[2 * k], found[2 * k + 1]
        assert np.array_equal(pair.b.read(), left) and np.array_equal(pair.a.read(), right)
        assert np.array_equal(back.b.read(), right) and np.array_equal(back.a.read(), left)
    assert fingerprint(found) == fingerprint(find_pairs(tmp_path / "train-0.parquet", how))
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(TrainingError, match=r"bad.parquet is no .parquet file"):
        find_pairs(tmp_path, how)


def test_folders_of_pairs_with_masks(tmp_path):
    inside = shapes.mask("disc")
    write(tmp_path / "mug-a.png", shapes.picture(inside))
    write(tmp_path / "mug-b.png", shapes.picture(inside, 1))
    (tmp_path / "mug-a.mask.png").write_bytes(shapes.mask_png(inside))
    for name in ("1", "2", "3"):
        write(tmp_path / "toy car" / f"{name}.png", shapes.picture(inside, int(name)))
    mug, first, second = find_pairs(tmp_path, ONE_WAY)
    assert mug.name == "mug" and mug.a.path.endswith("mug-a.png") and mug.b.path.endswith("b.png")
    assert mug.mask_a.endswith("mug-a.mask.png") and mug.mask_b == ""
    assert (first.name, second.name) == ("toy-car-1-2", "toy-car-2-3")
    assert first.b.path.endswith("1.png") and first.a.path == second.b.path
    both = find_pairs(tmp_path)
    assert len(both) == 6 and both[1].mask_b == mug.mask_a and both[1].name == "mug-back"
    assert pair_from(json.loads(json.dumps(asdict(mug)))) == mug


@pytest.mark.parametrize(
    "names",
    [
        ("кружка", "чашка", "чаш ка"), ("茶" * 60, "茶" * 60 + "碗"), ("मग", "मेग", "मिग"),
        ("!", "?", "🏺"), ("mug" * 40, "mug" * 40 + "s"), ("mug (1)", "mug [1]", "mug 1"),
    ],
)  # fmt: skip
def test_pairs_have_names_of_their_own_that_any_disk_takes(tmp_path, names):
    for where in (tmp_path / "pairs", tmp_path / "pairs" / ("täglich " * 20)):
        for name in names:
            write(where / f"{name}-a.png", two_halves()[1])
            write(where / f"{name}-b.png", two_halves()[2])
    found = find_pairs(tmp_path / "pairs")
    assert len(found) == 4 * len(names)
    for pair in found:
        assert not set(pair.name) & set('/\\?*:<>|" ')
        write(tmp_path / "out" / f".{pair.name}.coarse.png.12345678.unfinished", two_halves()[1])
    assert len(list((tmp_path / "out").iterdir())) == len(found)


def test_a_name_of_letters_in_any_script_is_kept(tmp_path):
    for name in ("кружка", "mug 1", "Krüge", "茶碗_2"):
        for side in "ab":
            write(tmp_path / f"{name}-{side}.png", two_halves()[1])
    names = {pair.name for pair in find_pairs(tmp_path, ONE_WAY)}
    assert names == {"кружка", "mug-1", "Krüge", "茶碗_2"}


def test_pairs_that_are_read_in_another_way_are_others(tmp_path):
    """A folder of triplets is gone on with by the same pairs only, wherever their pictures lie."""
    for home in ("one", "two"):
        write(tmp_path / home / "0.png", two_halves()[0])
        row = {"file_name": "0.png", "quality_assessment": GOOD}
        (tmp_path / home / "metadata.jsonl").write_text(json.dumps(row))
        for side in "ab":
            write(tmp_path / f"{home}-files" / f"mug-{side}.png", two_halves()[1])
    halves, files = tmp_path / "one", tmp_path / "one-files"
    narrow = SourceReading(both_ways=False, padding=0.01)
    found = [find_pairs(halves, how) for how in (ONE_WAY, narrow, SourceReading())]
    found.append(tuple(pair.turned_round for pair in found[0]))
    found.append(tuple(replace(pair, a=pair.b, b=pair.a) for pair in found[0]))
    found.append(find_pairs(files, ONE_WAY))
    for side in "ab":
        (files / f"mug-{side}.mask.png").write_bytes(shapes.mask_png(shapes.mask("disc")))
        found.append(find_pairs(files, ONE_WAY))
    assert len({fingerprint(pairs) for pairs in found}) == len(found)
    assert fingerprint(find_pairs(tmp_path / "two", narrow)) == fingerprint(found[1])
    assert fingerprint(find_pairs(tmp_path / "two-files", ONE_WAY)) == fingerprint(found[5])


def test_frames_of_a_video(tmp_path):
    frames = [cv2.resize(data.chelsea(), (96, 64)) // 4 + 6 * k for k in range(21)]
    video = tmp_path / "cat.mp4"
    video.write_bytes(encode_video(iter(frames), 10, ".mp4"))
    rate, count = frame_rate(video)
    assert (rate, count) == (10, 21)
    found = find_pairs(video, SourceReading(both_ways=False, seconds=0.5))
    assert [(p.b.index, p.a.index) for p in found] == [(0, 5), (5, 10), (10, 15), (15, 20)]
    for k in (0, 5, 20):
        read = PictureSource(str(video), "frame", k).read()
        errors = [np.abs(read.astype(int) - frame).mean() for frame in frames]
        assert int(np.argmin(errors)) == k
    assert len(read_frames(video, (3, 4))) == 2
    with pytest.raises(VideoError, match="has no frame 900"):
        read_frames(video, (900,))
    (tmp_path / "bad.mp4").write_bytes(b"\0" * 100)
    with pytest.raises(TrainingError, match=r"bad.mp4 is no video"):
        find_pairs(tmp_path)


def test_what_holds_no_pairs_is_one_sentence(tmp_path):
    for source, words in (
        (tmp_path / "none", "there is no"), (tmp_path, "holds no pairs"),
    ):  # fmt: skip
        with pytest.raises(TrainingError, match=words):
            find_pairs(source)
    (tmp_path / "a.txt").write_text("no")
    with pytest.raises(TrainingError, match=r"is no folder, video or .parquet file"):
        find_pairs(tmp_path / "a.txt")
    (tmp_path / "metadata.jsonl").write_text('{"file_name": "../../etc/none.png"}')
    with pytest.raises(TrainingError, match="there is no picture"):
        find_pairs(tmp_path)
    (tmp_path / "metadata.jsonl").write_text("{")
    with pytest.raises(TrainingError, match="cannot be read"):
        find_pairs(tmp_path)
    with pytest.raises(TrainingError, match="no layout 'rows'"):
        SourceReading("rows")
    pair = SourcePair("x", PictureSource(str(tmp_path / "gone.png")), PictureSource(""))
    with pytest.raises(TrainingError, match=r"gone.png cannot be read"):
        pair.b.read()
