"""A study's folder: what is asked, and one file a participant, replaced whole at every answer.

    study.json                 seed, subjects and methods, questions' names, number of checks
    participants/0001.json     the pages of one person, and what he or she has answered so far
    answers.csv                all of it as a table, whenever someone has finished

A participant is known by a random key, of which the file holds only a hash; nothing else about
people is kept. Several people may answer at once; one server writes a folder.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import secrets
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from objectmorpher_core.base.files import write_all

from ..evaluation.error import EvaluationError
from .design import CRITERIA, LEAST, MOST, Item, plan_items

FORMAT, VERSION = "objectmorpher study", 1
STUDY, PEOPLE, TABLE = "study.json", "participants", "answers.csv"
MOST_PEOPLE = 2000
MOST_SECONDS = 3600.0  # of one page


@dataclass(frozen=True)
class Study:
    """The settings that hold for everyone."""

    methods: Mapping[str, tuple[str, ...]]  # by subject: the methods whose results are rated
    seed: int = 0
    checks: int = 2
    id: str = ""  # tells one study's pages from another's in a browser


@dataclass(frozen=True)
class PageAnswer:
    """The answer to one page."""

    ratings: tuple[int, ...]  # by CRITERIA
    seconds: float  # that the page was in view
    at: str  # UTC, ISO 8601


@dataclass(frozen=True)
class Participant:
    """A person, as far as the file knows."""

    number: int  # from 1
    key_hash: str
    items: tuple[Item, ...]
    answers: Mapping[int, PageAnswer] = field(default_factory=dict)  # by item

    @property
    def is_finished(self) -> bool:
        """Whether every page is answered."""
        return len(self.answers) == len(self.items)


class StudyStore:
    """The folder, for one server; safe to use from several threads."""

    def __init__(self, folder: Path, study: Study) -> None:
        """Begins the study there, or goes on with it. Raises EvaluationError, OSError."""
        self.folder = folder
        self._lock = threading.Lock()
        (folder / PEOPLE).mkdir(parents=True, exist_ok=True)
        if (folder / STUDY).is_file():
            self.study = read_study(folder)
            if replace(self.study, id="") != replace(study, id=""):
                raise EvaluationError(
                    f"{folder} holds a study of other results, seed or checks; choose another --out"
                )
        else:
            self.study = replace(study, id=secrets.token_hex(8))
            write_all({folder / STUDY: _json_bytes(_study_tree(self.study))})
        self._people = {p.number: p for p in read_participants(folder)}
        self._by_hash = {p.key_hash: p.number for p in self._people.values()}

    def join(self) -> tuple[str, Participant]:
        """A new participant, and the key by which the browser is known again."""
        with self._lock:
            number = max(self._people, default=0) + 1
            if number > MOST_PEOPLE:
                raise EvaluationError(f"this study has {MOST_PEOPLE} participants already")
            key = secrets.token_urlsafe(24)
            study = self.study
            items = plan_items(study.methods, number - 1, study.seed, study.checks)
            person = Participant(number, _hash(key), items)
            self._keep(person)
            return key, person

    def find(self, key: str) -> Participant | None:
        """The participant whose key this is."""
        with self._lock:
            number = self._by_hash.get(_hash(key))
            return None if number is None else self._people[number]

    def answer(self, key: str, item: int, answer: PageAnswer) -> Participant:
        """Keeps an answer, on the disk when this returns; earlier ones may be given anew.

        Raises EvaluationError where it is none.
        """
        with self._lock:
            number = self._by_hash.get(_hash(key))
            if number is None:
                raise EvaluationError("there is no such participant")
            person = self._people[number]
            if not 0 <= item < len(person.items) or item > len(person.answers):
                raise EvaluationError("that page cannot be answered yet")
            check_answer(answer)
            person = replace(person, answers={**person.answers, item: answer})
            self._keep(person)
            if person.is_finished:
                people = sorted(self._people.values(), key=lambda p: p.number)
                write_all({self.folder / TABLE: encode_table(people)})
            return person

    def _keep(self, person: Participant) -> None:
        path = self.folder / PEOPLE / f"{person.number:04d}.json"
        write_all({path: _json_bytes(_person_tree(person))})
        self._people[person.number] = person
        self._by_hash[person.key_hash] = person.number


def check_answer(answer: PageAnswer) -> None:
    """Raises EvaluationError for what the page cannot have sent."""
    is_rating = all(type(r) is int and LEAST <= r <= MOST for r in answer.ratings)
    if len(answer.ratings) != len(CRITERIA) or not is_rating:
        raise EvaluationError(f"an answer is {len(CRITERIA)} numbers from {LEAST} to {MOST}")
    if not (math.isfinite(answer.seconds) and 0 <= answer.seconds <= MOST_SECONDS):
        raise EvaluationError(f"a page takes from 0 to {MOST_SECONDS:g} s")


def read_study(folder: Path) -> Study:
    """Raises EvaluationError where there is none, or one that cannot be read."""
    path = folder / STUDY
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        if told["format"] != FORMAT or told["version"] != VERSION:
            raise EvaluationError(f"{path} is no study that this version reads")
        methods = {str(s): tuple(str(m) for m in of) for s, of in told["methods"].items()}
        return Study(methods, int(told["seed"]), int(told["checks"]), str(told["id"]))
    except FileNotFoundError as error:
        raise EvaluationError(f"{folder} holds no study ({STUDY})") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        if isinstance(error, EvaluationError):
            raise
        raise EvaluationError(f"{path} cannot be read") from error


def read_participants(folder: Path) -> tuple[Participant, ...]:
    """Read all of a study's people, by number. Raises EvaluationError for a file that is none."""
    found = []
    for path in sorted((folder / PEOPLE).glob("*.json")):
        try:
            found.append(_person(json.loads(path.read_text(encoding="utf-8"))))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise EvaluationError(f"{path} is no participant's file") from error
    return tuple(sorted(found, key=lambda person: person.number))


def encode_table(people: Sequence[Participant]) -> bytes:
    """answers.csv: a line for each answer, of checks too."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(
        ["participant", "position", "subject", "method", *CRITERIA, "asked", "seconds", "at"]
    )
    for person in people:
        for k, answer in sorted(person.answers.items()):
            item = person.items[k]
            asked = " ".join(map(str, item.check))
            writer.writerow([
                person.number, k + 1, item.subject, item.method or "(check)", *answer.ratings,
                asked, f"{answer.seconds:.2f}", answer.at,
            ])  # fmt: skip
    return out.getvalue().encode()


def now() -> str:
    """UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def _study_tree(study: Study) -> dict[str, Any]:
    return {
        "format": FORMAT, "version": VERSION, "id": study.id, "seed": study.seed,
        "checks": study.checks, "criteria": list(CRITERIA),
        "methods": {subject: list(methods) for subject, methods in study.methods.items()},
    }  # fmt: skip


def _person_tree(person: Participant) -> dict[str, Any]:
    return {
        "number": person.number,
        "key_hash": person.key_hash,
        "items": [
            {"subject": i.subject} | ({"check": list(i.check)} if i.check else {"method": i.method})
            for i in person.items
        ],
        "answers": {
            str(k): {"ratings": list(a.ratings), "seconds": round(a.seconds, 3), "at": a.at}
            for k, a in sorted(person.answers.items())
        },
    }


def _person(told: dict[str, Any]) -> Participant:
    items = tuple(
        Item(str(i["subject"]), str(i.get("method", "")), tuple(i.get("check", ())))
        for i in told["items"]
    )
    answers: dict[int, PageAnswer] = {}
    for k, a in told["answers"].items():
        answer = PageAnswer(tuple(a["ratings"]), float(a["seconds"]), str(a["at"]))
        check_answer(answer)
        if not 0 <= int(k) < len(items):
            raise ValueError("an answer to no page")
        answers[int(k)] = answer
    return Participant(int(told["number"]), str(told["key_hash"]), items, answers)


def _hash(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()


def _json_bytes(value: Any) -> bytes:
    return (json.dumps(value, indent=1) + "\n").encode()
