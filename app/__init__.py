"""The program around objectmorpher_core: window and command line."""

__version__ = "0.1.0"
