"""Drawings over the photo: selection, clicks, handles, anchors, frames; a file per tool.

Shapes differ as well as colours, and every line has a dark outer line, so that they are seen on
any photo and by everybody.
"""
