"""Where the installed program begins: the window, a subcommand, or a process that it starts.

The program is also the Python of the processes that it starts itself: pip, which fetches weights,
and scripts of its own. Nothing else can be run by it.
"""

from __future__ import annotations

import multiprocessing
import os
import runpy
import sys
from pathlib import Path

INSIDE = Path(__file__).resolve().parent
CERTIFICATES = (  # of systems that keep them elsewhere than the one this was built on
    "/etc/ssl/certs/ca-certificates.crt",
    "/etc/pki/tls/certs/ca-bundle.crt",
    "/etc/ssl/ca-bundle.pem",
)


def main() -> int:
    """Runs what the arguments say; returns the exit code."""
    multiprocessing.freeze_support()
    if sys.argv[1:3] == ["-m", "pip"]:
        sys.argv[:3] = ["pip"]
        runpy.run_module("pip", run_name="__main__", alter_sys=True)
        return 0
    if sys.argv[1:2] == ["-P"] and is_own(Path(sys.argv[2])):
        del sys.argv[:2]
        runpy.run_path(sys.argv[0], run_name="__main__")
        return 0
    from objectmorpher_core.base import installation

    installation.prepare(INSIDE)
    trust_certificates()
    from objectmorpher.__main__ import run

    run()


def is_own(script: Path) -> bool:
    """Whether a script is one of the installation's."""
    return INSIDE in script.resolve().parents


def trust_certificates() -> None:
    """Encrypted connections are checked against this system's list."""
    import ssl

    if sys.platform == "linux" and ssl.get_default_verify_paths().cafile is None:
        found = next((name for name in CERTIFICATES if Path(name).is_file()), None)
        if found is not None:
            os.environ.setdefault("SSL_CERT_FILE", found)


if __name__ == "__main__":
    sys.exit(main())
