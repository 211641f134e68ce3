"""GitHub's workflows, read by actionlint, and a workflow with faults that it has to find."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# What stands in a workflow that is right, what is put there, what is then said. In one file is what
# does not hide another fault: an action without its version has no known inputs.
FAULTS = (
    {
        "ubuntu-24.04": ("ubuntu-24.4", 'label "ubuntu-24.4" is unknown'),
        "github.token": ("github.tokn", 'property "tokn" is not defined'),
        "needs: [python, ": ("needs: [pythn, ", 'job "pythn"'),
        "fetch-depth": ("depth", 'input "depth" is not defined'),
    },
    {"actions/checkout@v4": ("actions/checkout", "ref is missing")},
)


def checked(*files: Path) -> subprocess.CompletedProcess[str]:
    """What `packaging/check_workflows.sh` says of files, of the repository's by default."""
    done = subprocess.run(
        [ROOT / "packaging" / "check_workflows.sh", *files], capture_output=True, text=True
    )
    if done.returncode == 2:
        pytest.skip(f"actionlint is not to be had: {done.stderr.strip().splitlines()[-1]}")
    return done


@pytest.mark.slow
def test_workflows_are_what_github_takes() -> None:
    done = checked()
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(": no errors") == len(list((ROOT / ".github/workflows").glob("*.yml")))


@pytest.mark.slow
def test_faults_are_found(tmp_path: Path) -> None:
    whole = (ROOT / ".github" / "workflows" / "packages.yml").read_text("utf-8")
    whole = whole.replace("persist-credentials: false", "fetch-depth: 1", 1)
    files = [tmp_path / f"{number}.yml" for number in range(len(FAULTS))]
    for file, faults in zip(files, FAULTS, strict=True):
        text = whole
        for right, (wrong, _) in faults.items():
            assert right in text
            text = text.replace(right, wrong)
        file.write_text(text, "utf-8")
    done = checked(*files)
    assert done.returncode == 1
    for file, faults in zip(files, FAULTS, strict=True):
        lines = [line for line in done.stdout.splitlines() if f"{file}:" in line]
        for _, said in faults.values():
            assert any(said in line for line in lines), said


def test_a_workflow_keeps_no_credentials_on_the_disk() -> None:
    """What a step leaves there could be uploaded with the packages."""
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        text = path.read_text("utf-8")
        checkouts = text.count("uses: actions/checkout@")
        assert checkouts and text.count("persist-credentials: false") == checkouts, path.name
