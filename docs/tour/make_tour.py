"""Makes docs/tour and the pictures of the README anew: `make tour`.

Whole edits by a real pointer in the real window, on displays of their own (Xvfb and xdotool),
with a picture of every step. `python docs/tour/make_tour.py [dark] [light] [large] [views] [clip]`
makes some of them. It waits for what the window shows and not for a time, so it may run on a busy
machine.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "app")]

import clip  # noqa: E402
import platformdirs  # noqa: E402
import stories  # noqa: E402
import views  # noqa: E402
from guide import Guide, write_captions  # noqa: E402
from page import write_page  # noqa: E402

from hands import opened, window_environment, x_display  # noqa: E402

SIZE = (1440, 900)  # points
PICTURES = "Pictures"  # the folder, in the home of whoever is shown the tour, with the photos


@contextmanager
def home() -> Iterator[Path]:
    """A home folder with sample photos, so that paths in the pictures are nobody's."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / "assets/samples", folder / PICTURES)
        yield folder


@contextmanager
def stage(width: int, height: int) -> Iterator[tuple[dict[str, str], Path]]:
    """A display of so many px, and a home: the environment of a window, and the home's folder."""
    with home() as folder, x_display(width, height) as display:
        if display is None:
            raise SystemExit("no free X display was found")
        settings = f'dialogs = "built-in"\nexport_folder = "{folder / PICTURES}"\n'
        settings += 'motion = "reduced"\n'
        yield (
            window_environment(display, folder, settings)
            | {
                "HOME": str(folder),
                "XDG_DATA_HOME": str(platformdirs.user_data_path()),  # the models are there
                "XDG_CACHE_HOME": str(platformdirs.user_cache_path()),
            },
            folder,
        )


def record() -> None:
    """The README's clip of a drag."""
    size = ",".join(map(str, clip.SIZE))
    with stage(*clip.SIZE) as (environment, folder):
        photo = folder / PICTURES / "astronaut.jpg"
        with opened(environment, photo, "--theme", "dark", "--size", size):
            camera = clip.Camera(environment, folder / PICTURES)
            clip.film(camera)
    camera.save(ROOT / "docs" / "drag.webp")


def tell(story: stories.Story) -> None:
    """One edit, and a picture of each of its steps."""
    width, height = (round(side * story.scale) for side in SIZE)
    with stage(width, height) as (environment, folder):
        options = ("--theme", story.theme, "--scale", str(story.scale))
        with opened(environment, None, *options):
            guide = Guide(environment, HERE, story.name, story.photo_size, folder / PICTURES)
            story.tell(guide)
    pictures = {caption.file for caption in guide.captions}
    for old in HERE.glob(f"{story.name}-*.jpg"):
        if old.name not in pictures:
            old.unlink()
    write_captions(HERE, story.name, guide.captions)


def main() -> None:
    wanted = sys.argv[1:] or [*stories.STORIES, "views", "clip"]
    os.chdir(ROOT)
    for name in wanted:
        print(name)
        if name == "views":
            views.make(ROOT / "docs")
        elif name == "clip":
            record()
        else:
            tell(stories.STORIES[name])
    write_page(HERE)


if __name__ == "__main__":
    main()
