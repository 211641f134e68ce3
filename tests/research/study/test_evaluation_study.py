"""Studies: balanced orders, answers that are kept, who counts, agreement, figures, chart."""

from __future__ import annotations

import csv
import io
import json
import threading
import xml.etree.ElementTree as ET
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.study.agreement import ordinal_alpha
from objectmorpher_research.study.chart import draw_chart
from objectmorpher_research.study.design import CRITERIA, plan_items, williams_design
from objectmorpher_research.study.figures import RULES, excluded_by, figures
from objectmorpher_research.study.store import (
    PageAnswer,
    Participant,
    Study,
    StudyStore,
    encode_table,
    read_participants,
)

METHODS = {"cat": ("a", "b", "c"), "cup": ("a", "b", "c"), "dog": ("a", "b")}
NAN = float("nan")
F64 = 1e-9


def answered(person: Participant, rate, seconds: float = 9.0) -> Participant:
    """A participant who gives `rate(item)` to every result, and what checks ask."""
    answers = {
        k: PageAnswer(item.check or rate(item), seconds, "2026-01-01T00:00:00+00:00")
        for k, item in enumerate(person.items)
    }
    return Participant(person.number, person.key_hash, person.items, answers)


def person(number: int, seed: int = 0, checks: int = 2) -> Participant:
    return Participant(number, f"hash{number}", plan_items(METHODS, number - 1, seed, checks))


@pytest.mark.parametrize("count", range(1, 9))
def test_williams_designs_are_balanced(count):
    rows = williams_design(count)
    places = Counter((k, thing) for row in rows for k, thing in enumerate(row))
    follows = Counter(pair for row in rows for pair in pairwise(row))
    assert all(sorted(row) == list(range(count)) for row in rows)
    assert len(places) == count**2 and len(set(places.values())) == 1
    assert len(follows) == count * (count - 1) and len(set(follows.values())) <= 1


def test_orders_are_balanced_over_participants():
    """Over 12 people: each method as often first, second, third; each subject as often first."""
    people = [plan_items(METHODS, n, seed=3, checks=0) for n in range(12)]
    firsts = Counter(items[0].subject for items in people)
    assert set(firsts.values()) == {4}
    places: Counter[tuple[str, str, int]] = Counter()
    for items in people:
        for subject in METHODS:
            own = [item.method for item in items if item.subject == subject]
            assert sorted(own) == list(METHODS[subject])
            places.update((subject, method, k) for k, method in enumerate(own))
    assert {n for (s, _, _), n in places.items() if s != "dog"} == {4}
    assert {n for (s, _, _), n in places.items() if s == "dog"} == {6}


def test_a_plan_is_the_seed_s_and_keeps_subjects_together():
    assert plan_items(METHODS, 4, 7, 2) == plan_items(METHODS, 4, 7, 2)
    assert plan_items(METHODS, 4, 7, 2) != plan_items(METHODS, 4, 8, 2)
    for number in range(20):
        items = plan_items(METHODS, number, 1, 3)
        checks = [item for item in items if item.check]
        assert len(checks) == 3 and not items[0].check
        assert all(
            len(set(check.check)) > 1 and set(check.check) <= set(range(1, 6)) for check in checks
        )
        results = [item.subject for item in items if item.method]
        assert len(results) == 8
        assert sum(a != b for a, b in pairwise(results)) == 2


def test_answers_are_on_the_disk_when_they_are_given(tmp_path):
    store = StudyStore(tmp_path, Study(METHODS, seed=1))
    key, joined = store.join()
    store.answer(key, 0, PageAnswer((1, 2, 3), 4.5, "t"))
    store.answer(key, 0, PageAnswer((5, 2, 3), 4.5, "t"))  # thought better of it
    (found,) = read_participants(tmp_path)
    assert found.answers[0].ratings == (5, 2, 3) and found.items == joined.items
    assert key not in "".join(p.read_text() for p in tmp_path.rglob("*.json"))
    again = StudyStore(tmp_path, Study(METHODS, seed=1))
    assert again.find(key) == found and again.study.id == store.study.id
    assert again.join()[1].number == 2


def test_another_study_does_not_mix_with_the_first(tmp_path):
    StudyStore(tmp_path, Study(METHODS, seed=1))
    for other in (Study(METHODS, seed=2), Study({"cat": ("a",)}, seed=1), Study(METHODS, 1, 3)):
        with pytest.raises(EvaluationError, match="another --out"):
            StudyStore(tmp_path, other)


@pytest.mark.parametrize(
    ("item", "answer", "told"),
    [
        (1, PageAnswer((1, 2, 3), 1, "t"), "cannot be answered yet"),
        (-1, PageAnswer((1, 2, 3), 1, "t"), "cannot be answered yet"),
        (99, PageAnswer((1, 2, 3), 1, "t"), "cannot be answered yet"),
        (0, PageAnswer((1, 2), 1, "t"), "3 numbers from 1 to 5"),
        (0, PageAnswer((1, 2, 6), 1, "t"), "3 numbers from 1 to 5"),
        (0, PageAnswer((1, 2, True), 1, "t"), "3 numbers from 1 to 5"),
        (0, PageAnswer((1, 2, 2.0), 1, "t"), "3 numbers from 1 to 5"),  # type: ignore[arg-type]
        (0, PageAnswer((1, 2, 3), NAN, "t"), "a page takes"),
        (0, PageAnswer((1, 2, 3), -1, "t"), "a page takes"),
    ],
)
def test_what_is_no_answer_is_refused(tmp_path, item, answer, told):
    store = StudyStore(tmp_path, Study(METHODS))
    key, _ = store.join()
    with pytest.raises(EvaluationError, match=told):
        store.answer(key, item, answer)
    assert not read_participants(tmp_path)[0].answers
    with pytest.raises(EvaluationError, match="no such participant"):
        store.answer(key + "x", 0, PageAnswer((1, 2, 3), 1, "t"))


def test_several_people_answer_at_once(tmp_path):
    store = StudyStore(tmp_path, Study(METHODS, checks=1))

    def take_part(rating: int) -> None:
        key, joined = store.join()
        for k, item in enumerate(joined.items):
            store.answer(key, k, PageAnswer(item.check or (rating,) * 3, 3.0, "t"))

    threads = [threading.Thread(target=take_part, args=(1 + n % 5,)) for n in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    people = read_participants(tmp_path)
    assert [p.number for p in people] == [1, 2, 3, 4, 5, 6] and all(p.is_finished for p in people)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "answers.csv").read_text())))
    assert len(rows) == 6 * 9
    assert (tmp_path / "answers.csv").read_bytes() == encode_table(people)


def test_who_does_not_count():
    whole = person(1)

    def varied(item):
        return (1 + len(item.method + item.subject) % 5, 3, 4)

    assert excluded_by(answered(whole, varied)) == ""
    some = answered(whole, varied)
    part = Participant(1, "h", whole.items, {k: a for k, a in some.answers.items() if k < 3})
    assert excluded_by(part) == RULES[0]
    wrong = dict(some.answers)
    k = next(k for k, item in enumerate(whole.items) if item.check)
    wrong[k] = PageAnswer(tuple(1 + r % 5 for r in whole.items[k].check), 9, "t")
    assert excluded_by(Participant(1, "h", whole.items, wrong)) == RULES[1]
    assert excluded_by(answered(whole, varied, seconds=1.0)) == RULES[2]
    assert excluded_by(answered(whole, lambda item: (3, 3, 3))) == RULES[3]


def test_means_are_those_of_who_counts():
    marks = {"a": (5, 4, 3), "b": (2, 2, 2), "c": (1, 3, 5)}
    people = [answered(person(n), lambda item: marks[item.method]) for n in range(1, 6)]
    people.append(answered(person(6), lambda item: (1, 1, 1)))
    found = figures(people)
    assert found.participants == 6 and found.counted == 5 and found.excluded == {6: RULES[3]}
    assert [m.method for m in found.methods] == ["a", "b", "c"]
    for method in found.methods:
        assert tuple(method.means[c].value for c in CRITERIA) == marks[method.method]
        assert method.means["guidance"].low == method.means["guidance"].value  # nobody differs
    assert [m.ratings for m in found.methods] == [15, 15, 10]
    assert all(found.alpha[c].value == pytest.approx(1) for c in CRITERIA)


def test_intervals_are_over_participants_not_over_ratings():
    """Each person is of one mind about everything: 10 people are 10 opinions, not 80."""
    random = np.random.default_rng(0)
    minds = random.integers(2, 5, 10)
    people = [answered(person(n + 1), lambda item, n=n: (int(minds[n]), 3, 4)) for n in range(10)]
    mean = figures(people).methods[0].means["guidance"]
    assert mean.value == pytest.approx(minds.mean())
    assert mean.low is not None and mean.high is not None
    error = minds.std() / np.sqrt(10)
    assert (mean.high - mean.low) / 2 == pytest.approx(1.96 * error, rel=0.1)


def test_intervals_hold_the_truth_nineteen_times_in_twenty():
    """Of 60 made studies with 12 people, whose means spread normally around 3."""
    random = np.random.default_rng(1)
    held = 0
    items = [person(n + 1, checks=0) for n in range(12)]
    values = np.arange(1, 6)
    for _ in range(60):
        shares = random.dirichlet(np.ones(5))
        drawn = random.choice(values, 12, p=shares)
        people = [
            answered(p, lambda item, r=int(r): (r, 1, 5)) for p, r in zip(items, drawn, strict=True)
        ]
        mean = figures(people).methods[0].means["guidance"]
        held += mean.low - F64 <= float(values @ shares) <= mean.high + F64  # type: ignore[operator]
    assert held >= 0.84 * 60  # percentile intervals of 12 opinions are a little short


def test_nobody_counts():
    found = figures([person(1)])
    assert found.counted == 0 and found.methods == () and found.alpha == {}
    ET.fromstring(draw_chart(found))


# Krippendorff 2011 (Computing Krippendorff's Alpha-Reliability), section C: 4 observers, 12 units.
PUBLISHED = [
    [1, 2, 3, 3, 2, 1, 4, 1, 2, NAN, NAN, NAN],
    [1, 2, 3, 3, 2, 2, 4, 1, 2, 5, NAN, 3],
    [NAN, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, NAN],
    [1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, NAN],
]


def brute_force_alpha(ratings: np.ndarray) -> float:
    """The definition, pair by pair: mean disagreement within units over that of all pairs."""
    units = [[int(v) for v in column if not np.isnan(v)] for column in ratings.T]
    units = [unit for unit in units if len(unit) > 1]
    given = [v for unit in units for v in unit]
    n = Counter(given)

    def apart(c: int, k: int) -> float:
        low, high = sorted((c, k))
        return (sum(n[g] for g in range(low, high + 1)) - (n[c] + n[k]) / 2) ** 2 if c != k else 0

    observed = sum(
        apart(a, b) / (len(unit) - 1)
        for unit in units
        for i, a in enumerate(unit)
        for j, b in enumerate(unit)
        if i != j
    ) / len(given)
    expected = sum(
        apart(a, b) for i, a in enumerate(given) for j, b in enumerate(given) if i != j
    ) / (len(given) * (len(given) - 1))
    return 1 - observed / expected


def test_alpha_of_a_published_example():
    assert ordinal_alpha(np.array(PUBLISHED)).value == pytest.approx(0.815, abs=5e-4)


@pytest.mark.parametrize("seed", range(8))
def test_alpha_is_its_definition(seed):
    random = np.random.default_rng(seed)
    truth = random.integers(1, 6, 15)
    noise = random.integers(-seed % 3 - 1, seed % 3 + 2, (6, 15))
    ratings = np.clip(truth + noise, 1, 5).astype(float)
    ratings[random.random(ratings.shape) < 0.3] = NAN
    assert ordinal_alpha(ratings).value == pytest.approx(brute_force_alpha(ratings), abs=F64)


def test_alpha_of_chance_and_of_one_mind():
    random = np.random.default_rng(0)
    chance = ordinal_alpha(random.integers(1, 6, (10, 400)).astype(float))
    assert abs(chance.value) < 0.03 and chance.low is not None and chance.low < 0 < chance.high  # type: ignore[operator]
    alike = np.repeat(random.integers(1, 6, (1, 30)), 4, axis=0).astype(float)
    assert ordinal_alpha(alike).value == pytest.approx(1)
    assert np.isnan(ordinal_alpha(np.full((3, 5), 4.0)).value)
    assert np.isnan(ordinal_alpha(np.array([[1.0, 2, 3]])).value)  # one rater


def test_alpha_minds_order_and_not_names():
    """Neighbouring marks are less apart than distant ones; turning the scale round is nothing."""
    near = np.array([[1, 2, 3, 4, 5, 1, 5, 3], [2, 2, 3, 4, 4, 1, 5, 3]], float)
    far = np.array([[1, 2, 3, 4, 5, 1, 5, 3], [5, 2, 3, 4, 1, 1, 5, 3]], float)
    assert ordinal_alpha(near).value > ordinal_alpha(far).value
    assert ordinal_alpha(6 - near).value == pytest.approx(ordinal_alpha(near).value)


def test_the_chart_is_a_picture_of_its_own():
    people = [
        answered(person(n), lambda item, n=n: (1 + (n + len(item.subject)) % 5, 3, 4))
        for n in range(1, 5)
    ]
    text = draw_chart(figures(people)).replace('xmlns="http://www.w3.org/2000/svg"', "")
    assert "http" not in text and "<script" not in text
    tree = ET.fromstring(text)
    assert len(tree.findall("circle")) == 3 * 3


def test_names_in_the_chart_are_text():
    methods = {"s": ('<script>alert("x")</script>', "b & c")}
    plan = plan_items(methods, 0, 0, 0)
    found = figures([answered(Participant(1, "h", plan), lambda item: (1, 2, 3))])
    texts = [element.text for element in ET.fromstring(draw_chart(found)).iter()]
    assert '<script>alert("x")</script>' in texts and "<script" not in draw_chart(found)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"number": 1}', '{"number": 1, "key_hash": 2}'])
def test_a_damaged_file_is_one_sentence(tmp_path, text):
    store = StudyStore(tmp_path, Study(METHODS))
    store.join()
    (tmp_path / "participants" / "0001.json").write_text(text)
    with pytest.raises(EvaluationError, match=r"0001\.json is no participant's file"):
        read_participants(tmp_path)


def test_answers_that_no_page_gives_are_not_read(tmp_path):
    store = StudyStore(tmp_path, Study(METHODS))
    key, _ = store.join()
    store.answer(key, 0, PageAnswer((1, 2, 3), 1.0, "t"))
    path: Path = tmp_path / "participants" / "0001.json"
    told = json.loads(path.read_text())
    for ratings in ([1, 2, 9], [1, 2], ["1", 2, 3]):
        told["answers"]["0"]["ratings"] = ratings
        path.write_text(json.dumps(told))
        with pytest.raises(EvaluationError, match="no participant's file"):
            read_participants(tmp_path)
