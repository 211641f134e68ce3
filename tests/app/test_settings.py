"""The user's settings: what cannot be read is the default, and nothing is lost on the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from objectmorpher.editor.settings import Backends, Settings, read_settings, write_settings


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "settings.toml"
    settings = Settings(
        theme="light", scale=1.5, recent=('/a "b"\\c.jpg', "/ü.png"), backends=Backends("grabcut")
    )
    write_settings(path, settings)
    assert read_settings(path) == settings


def test_no_file_is_the_default(tmp_path: Path) -> None:
    assert read_settings(tmp_path / "none.toml") == Settings()


def test_nonsense_is_the_default(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_bytes(b"\xff\xfe theme = [")
    assert read_settings(path) == Settings()
    path.write_text('theme = 3\nquality = "high"\nunknown = 1\nscale = 2\nbackends = 5\n')
    assert read_settings(path) == replace(Settings(), scale=2.0)


def test_recent_files_are_few_and_newest_first() -> None:
    settings = Settings()
    for i in range(9):
        settings = settings.with_recent(Path(f"/photos/{i}.jpg"))
    settings = settings.with_recent(Path("/photos/7.jpg"))
    names = [Path(r).name for r in settings.recent]
    assert names == ["7.jpg", "8.jpg", "6.jpg", "5.jpg", "4.jpg", "3.jpg"]
