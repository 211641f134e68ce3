"""Makes docs/howto/web.jpg: the editor in a browser, with a cup that is turned.

`python docs/howto/shoot_web.py`; it needs Chromium and its driver (`make .make/browser`).
"""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from objectmorpher.server.address import make_token  # noqa: E402
from objectmorpher.server.web_editor import WebServer  # noqa: E402
from tests.browser import opened_browser  # noqa: E402

PICTURE = Path(__file__).with_name("web.jpg")
FRAME = "document.getElementById('frame').contentWindow"
MOST = 64 << 20  # bytes of a photo
QUALITY = 85


def main() -> None:
    """Open the cup, choose it by its subject, lift and turn it."""
    token = make_token()
    server = WebServer(("127.0.0.1", 0), token, MOST)
    server.start()
    try:
        with opened_browser() as page:
            page.open(f"{server.url}/#token={token}")
            page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
            page.run("document.querySelector('#samples img[alt=coffee]').parentElement.click()")
            page.wait("document.body.dataset.step === 'select'", "the photo")
            page.run("document.getElementById('subject').click()")
            page.wait("!document.getElementById('lift').disabled", "the selection")
            page.run("document.getElementById('lift').click()")
            page.wait("document.body.dataset.step === 'drag'", "lifting")
            page.wait(f"{FRAME}.objectmorpher && {FRAME}.objectmorpher.isStill", "drawing")
            page.drag((60, 300), (110, 300))  # beside the object: turns it
            page.wait(f"{FRAME}.objectmorpher.isStill", "turning")
            Image.fromarray(page.picture()).save(PICTURE, quality=QUALITY)
    finally:
        server.close()


if __name__ == "__main__":
    main()
