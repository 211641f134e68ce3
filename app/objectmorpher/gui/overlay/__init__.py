"""What is drawn over the photo: selection, clicks, handles, anchors, frames; a tool a file.

Shapes differ as well as colours, and every line has a dark outer line, so that they are seen on
any photo and by everybody.
"""
