"""What the worker remembers between two jobs."""

from __future__ import annotations

import numpy as np

from objectmorpher.worker.job_functions import PhotoMemory
from objectmorpher_core.base.progress import silent
from tests import shapes


def test_a_photo_is_read_once() -> None:
    memory = PhotoMemory()
    pixels = shapes.picture(shapes.mask("disc"))
    first = memory.reading(pixels, "grabcut", silent)
    assert memory.reading(pixels.copy(), "grabcut", silent) is first
    other = memory.reading(np.zeros_like(pixels), "grabcut", silent)
    assert other is not first
    assert other.segmenter is first.segmenter, "the loaded model stays"
    assert memory.reading(pixels, "grabcut", silent) is not first, "not two photos at a time"
