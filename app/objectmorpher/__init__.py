"""The program around objectmorpher_core: window and command line."""

from objectmorpher_core import __version__

__all__ = ["__version__"]
