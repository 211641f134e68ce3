"""Messages from and to the study's page: plain values in, plain values out, no HTTP."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..evaluation.subjects.subject import EvaluatedEdit
from .design import Item
from .pictures import StudyPictures
from .store import (
    PageAnswer,
    Participant,
    Study,
    StudyStore,
    check_answer,
    now,
)

SECONDS = 15  # that a page is expected to take
CONSENT = """Taking part is voluntary. You can stop at any time by closing the page; what you have answered by then is kept, but does not count.
Kept are your marks, when you gave them, how long each page was in view, and a number. Your name, your address and what kind of browser you use are not kept. Nothing is sent to anyone but the computer that shows you this page.
If you reload the page, it goes on where you were."""  # noqa: E501


class QuestionError(Exception):
    """The page asks for something that makes no sense here; one sentence."""


class Pages:
    """A study, for one server."""

    def __init__(
        self, store: StudyStore, subjects: Sequence[EvaluatedEdit], consent: str = CONSENT
    ) -> None:
        """Raises EvaluationError for pictures that cannot be shown."""
        self._store = store
        self._subjects = {subject.name: subject for subject in subjects}
        self.pictures = StudyPictures(subjects)
        self._consent = consent

    def about(self, said: Mapping[str, Any]) -> dict[str, Any]:
        """Return the facts that everyone may know."""
        count = sum(len(methods) for methods in self._store.study.methods.values())
        minutes = max(1, round((count + self._store.study.checks) * SECONDS / 60))
        return {
            "study": self._store.study.id, "results": count, "minutes": minutes,
            "consent": self._consent,
        }  # fmt: skip

    def begin(self, said: Mapping[str, Any]) -> dict[str, Any]:
        """A new participant. Raises QuestionError without consent, EvaluationError."""
        if said.get("agreed") is not True:
            raise QuestionError("there is no consent")
        key, person = self._store.join()
        return {"key": key, "study": self._store.study.id, **self._state(person)}

    def state(self, said: Mapping[str, Any]) -> dict[str, Any]:
        """Return the state of a participant. Raises QuestionError."""
        person = self._store.find(_key(said))
        if person is None:
            raise QuestionError("there is no such participant")
        return self._state(person)

    def answer(self, said: Mapping[str, Any]) -> dict[str, Any]:
        """Keeps an answer. Raises QuestionError, EvaluationError for what is none."""
        item, ratings, seconds = said.get("item"), said.get("ratings"), said.get("seconds")
        if type(item) is not int or not isinstance(ratings, list):
            raise QuestionError("that is no answer")
        if isinstance(seconds, bool) or not isinstance(seconds, int | float):
            raise QuestionError("that is no answer")
        answer = PageAnswer(tuple(ratings), float(min(max(seconds, -1), 1e9)), now())
        check_answer(answer)
        return {"finished": self._store.answer(_key(said), item, answer).is_finished}

    def _state(self, person: Participant) -> dict[str, Any]:
        originals = {i.subject: self.pictures.name_original(i.subject) for i in person.items}
        return {
            "number": person.number,
            "items": [self._item(item, originals[item.subject]) for item in person.items],
            "answers": {str(k): list(a.ratings) for k, a in person.answers.items()},
        }

    def _item(self, item: Item, original: str) -> dict[str, Any]:
        """A page. The method's name is not in it, nor anything that two of its results share."""
        if item.check:
            return {"asked": list(item.check)}
        width, height = self.pictures.size(item.subject)
        return {
            "original": f"picture/{original}",
            "result": f"picture/{self.pictures.name_result(item.subject, item.method)}",
            "size": [width, height],
            "guidance": self._guidance(self._subjects[item.subject], width),
        }

    def _guidance(self, subject: EvaluatedEdit, width: int) -> dict[str, Any]:
        guidance = subject.guidance
        picture = self.pictures.name_guidance(subject.name)
        scale = width / self.pictures.photo_width(subject.name)
        arrows = [[scale * v for end in arrow for v in end] for arrow in guidance.arrows]
        told: dict[str, Any] = {"words": guidance.words, "picture": None, "arrows": arrows}
        if picture is not None:
            name, size = picture
            told |= {"picture": f"picture/{name}", "size": list(size), "arrows": []}
        return told


def study_of(subjects: Sequence[EvaluatedEdit], seed: int, checks: int) -> Study:
    """The study of all results of some subjects."""
    return Study({s.name: tuple(sorted(s.results)) for s in subjects if s.results}, seed, checks)


def _key(said: Mapping[str, Any]) -> str:
    key = said.get("key")
    if not isinstance(key, str) or len(key) > 100:
        raise QuestionError("there is no such participant")
    return key
