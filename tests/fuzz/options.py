"""The whole command line with values that nobody means: `make fuzz-options RUNS=20000`.

`python -m tests.fuzz.options --runs N [--seed S] [--report F.json]`. Hypothesis draws command lines
of every option that the parser knows, on photos of extreme shapes and of all kinds of pixels, and
one warm process runs them, bounded in memory and in processor time for each. A run must end with
the picture that was asked for, or with one sentence and nothing written. Exits with 1 where one
did not; its command line is printed, and the files it was run on stay in --keep FOLDER.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

from objectmorpher import __main__ as program
from objectmorpher.cli.parser import UNFORESEEN
from objectmorpher_core.pictures.image import ENDINGS, read_picture
from tests.tree import PYTHONPATH

from .checks import check_picture, check_sentence
from .child import bound, say
from .command_lines import OUTPUTS, command_lines
from .shapes_of_photos import make_files

ROOT = Path(__file__).parents[2]
MEMORY = 3 << 30  # bytes of address space beyond what the first runs took
SECONDS = 100  # of processor time for a run
TURN = 400  # runs of one process
MOST_WAIT = 1e6  # s, which a system call takes
NOW = "now"  # the command line that is being run
FIRST = (  # what is imported and compiled late comes before the limits
    ["edit", "p/plain.png", "-o", "o.png", "--mask", "p/plain-mask.png", "--move", "5,5",
     "--handle", "32,24:36,26", "--refine", "harmonise", "--session", "o.omorph"],
    ["edit", "p/plain.png", "-o", "o.png", "--click", "32,24", "--turn", "9,0,0", "--seed", "1"],
)  # fmt: skip


COMPILING = "compiling for this processor, once"  # the first edit after an installation says so


def verdict(words: list[str]) -> tuple[str, str]:
    """Whether a run gave a picture ("done"), one sentence ("refused"), or neither, and why."""
    for name in OUTPUTS:
        if Path(name).is_dir():  # of a batch
            shutil.rmtree(name)
        Path(name).unlink(missing_ok=True)
    with _redirected() as told:
        try:
            code: Any = program.main(words)
        except SystemExit as ended:
            code = ended.code
        except BaseException as error:
            return "found", f"{type(error).__name__}: {error}"
    try:
        said = Path(told).read_text(encoding="utf-8", errors="replace")
        said = "".join(line for line in said.splitlines(True) if COMPILING not in line)
        if code in (0, None):
            notes = said.splitlines()  # a shadow that goes along is named, a doubtful front too
            is_plain = all(n.startswith("objectmorpher: ") and UNFORESEEN not in n for n in notes)
            assert is_plain, f"done, but said {said[:200]!r}"
            _check_outputs(words)
            return "done", ""
        check_sentence(said.removesuffix("\n"))
        assert said.startswith("objectmorpher: ") and UNFORESEEN not in said, said[:400]
        left = [name for name in OUTPUTS if Path(name).exists()]
        assert not left or words[0] == "batch", f"refused, but wrote {left}"
    except Exception as error:
        return "found", f"{error}"
    return "refused", said


def _check_outputs(words: list[str]) -> None:
    """What was asked for is there; a picture has the size of its photo."""
    if words[0] not in ("edit", "select", "replay"):
        return
    out = Path(words[words.index("-o") + 1])
    assert out.exists(), f"{out} is missing"
    if out.suffix.lower() in ENDINGS and words[0] != "replay":
        made, photo = (read_picture(path.read_bytes()) for path in (out, Path(words[1])))
        check_picture(made)
        assert made.pixels.shape == photo.pixels.shape


@contextmanager
def _redirected() -> Iterator[str]:
    """What the process writes to stdout and stderr, native code included, goes to files."""
    streams = sys.stdout, sys.stderr
    for stream in streams:
        stream.flush()
    saved = os.dup(1), os.dup(2)
    for number, name in ((1, "stdout"), (2, "stderr")):
        target = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(target, number)
        os.close(target)
    sys.stdout, sys.stderr = (
        open(number, "w", closefd=False, encoding="utf-8")  # noqa: SIM115  a pytest's are not these
        for number in (1, 2)
    )
    try:
        yield "stderr"
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = streams
        for number, old in enumerate(saved, 1):
            os.dup2(old, number)
            os.close(old)


def child(number: int, count: int) -> None:
    """Runs `count` command lines in the current folder, and says what became of them."""
    make_files(Path("p"))
    for words in FIRST:
        how = verdict(words)
        assert how[0] == "done", how
    bound(MEMORY)
    tally: Counter[str] = Counter()

    @seed(number)
    @settings(max_examples=count, database=None, deadline=None, phases=[Phase.generate],
              suppress_health_check=[*HealthCheck])  # fmt: skip
    @given(command_lines())
    def run(words: list[str]) -> None:
        Path(NOW).write_text(json.dumps({"words": words, "tally": tally}), encoding="utf-8")
        signal.setitimer(signal.ITIMER_PROF, SECONDS)  # its signal ends the process
        start = time.process_time()
        how, why = verdict(words)
        signal.setitimer(signal.ITIMER_PROF, 0)
        tally[how] += 1
        tally["longest, ms"] = max(
            tally["longest, ms"], round(1000 * (time.process_time() - start))
        )
        if how == "found":
            say(found={"words": words, "how": why})

    run()
    say(done=tally)


def fuzz(number: int, runs: int, seconds: float, keep: Path | None = None) -> dict[str, Any]:
    """What became of so many runs, or of as many as there was time for."""
    total: Counter[str] = Counter()
    found: list[dict[str, Any]] = []
    end, longest = time.monotonic() + seconds, 0
    while sum(total.values()) < runs and time.monotonic() < end:
        count = min(TURN, runs - sum(total.values()))
        with tempfile.TemporaryDirectory() as scratch:
            folder = keep or Path(scratch)
            folder.mkdir(parents=True, exist_ok=True)
            tally = _one_process(folder, number, count, end - time.monotonic(), found)
        longest = max(longest, tally.pop("longest, ms", 0))
        total.update(tally)
        number += 1
    return {"runs": dict(total), "longest_ms": longest, "found": found}


def _one_process(
    folder: Path, number: int, count: int, seconds: float, found: list[dict[str, Any]]
) -> dict[str, int]:
    (folder / NOW).unlink(missing_ok=True)
    environment = os.environ | {"PYTHONPATH": PYTHONPATH, "OPENBLAS_NUM_THREADS": "1",
                                "XDG_CONFIG_HOME": str(folder / "config")}  # fmt: skip
    environment.pop("DISPLAY", None)
    command = [sys.executable, "-m", "tests.fuzz.options", "--child", str(number), str(count)]
    with (folder / "noise").open("w+") as noise:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=noise, text=True
        )
        try:
            told, _ = process.communicate(timeout=min(seconds + 60, MOST_WAIT))
        except subprocess.TimeoutExpired:  # there is no more time: what was run counts
            process.kill()
            told, _ = process.communicate()
    said = [json.loads(line) for line in told.splitlines() if line.startswith("{")]
    new = [line["found"] for line in said if "found" in line]
    for each in new:
        print(f"FOUND {each['how'][:300]}\n      {' '.join(each['words'])[:600]}", flush=True)
    found += new
    done = next((line["done"] for line in said if "done" in line), None)
    if done is not None:
        return done
    if not (folder / NOW).exists():
        raise RuntimeError((folder / "noise").read_text()[-2000:] or "the process did not begin")
    now = json.loads((folder / NOW).read_text(encoding="utf-8"))
    if process.returncode != -signal.SIGKILL:
        how = f"ended with {process.returncode}: more than {SECONDS} s, or a crash"
        found.append({"words": now["words"], "how": how})
        print(f"FOUND {how}\n      {' '.join(now['words'])[:600]}", flush=True)
    return now["tally"] | {"ended": 1}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.options", description=__doc__)
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=1e9, help="at most")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--keep", type=Path, help="the folder in which it is run")
    parser.add_argument("--report", type=Path, help="a JSON file of what became of the runs")
    parser.add_argument("--child", type=int, nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(*options.child)
        return 0
    result = fuzz(options.seed, options.runs, options.seconds, options.keep)
    if options.report is not None:
        options.report.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(f"{result['runs']}, the longest {result['longest_ms']} ms; {len(result['found'])} found")
    return int(bool(result["found"]))


if __name__ == "__main__":
    with suppress(BrokenPipeError):
        sys.exit(main())
