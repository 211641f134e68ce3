"""Limits on the claims of a file or a message: everything that is read is checked against them.

A limit is refused with one sentence, before anything is allocated for it. docs/reliability-tests.md
lists them; a test keeps that list complete.
"""

from __future__ import annotations

# Pictures and sessions
PICTURE_PIXELS = 250_000_000  # a larger picture does not fit an ordinary machine's memory thrice
FILE_BYTES = 4 << 30  # bytes of any file that is opened
SESSION_UNPACKED = 4 << 30  # bytes of all that is read of it: more than any real session
SESSION_DOCUMENT = 8 << 20  # bytes of document.json; 256 objects have 1 MB
SESSION_DIRECTORY = 8 << 20  # bytes of the zip file's directory; 256 objects have 1 MB
SESSION_RATIO = 16  # x a member's packed bytes, beyond which what it unpacks to is excess
SESSION_EXCESS = 192 << 20  # bytes of excess, of all members
SESSION_FILE_SHARE = 16  # bytes of excess more for each byte of the session's file
SESSION_OBJECTS = 256  # each costs a moment when the session is opened

# Gaussians
GAUSSIANS = 20_000_000  # 1.1 GB as `Gaussians`; large city scans have some 10 million
SPLATS_UNPACKED = 1 << 30  # bytes of what a packed file unpacks to
PLY_HEADER = 1 << 16  # bytes; the longest real header (degree 3) has 2 KB
PLY_LINE = 1 << 14  # bytes of a row written as text; 62 numbers need 1.5 KB

# Meshes
MESH_BYTES = 1 << 30  # bytes of the file
MESH_ASSET = 1 << 28  # bytes of a texture or buffer beside it
MESH_JSON = 1 << 26  # bytes of a glTF file's text
MESH_TRIANGLES = 5_000_000
MESH_VERTICES = 15_000_000
MESH_NODES = 100_000
MESH_DEPTH = 128  # nodes below each other
TEXTURE_SIDE = 8192  # px

# Workers, and weights
WORKER_FILE = 1 << 16  # bytes of worker.toml, and of what a worker leaves as JSON
WORKER_GAUSSIANS = 2_000_000  # that a worker may leave
WEIGHTS_HEADER = 100 << 20  # bytes of a .safetensors header; the format's own limit

# Messages between a window and a server
MESSAGE_HEADER = 4 << 20  # bytes
MESSAGE_ARRAYS = 256
MESSAGE_AXES = 8
MESSAGE_DEPTH = 24  # of the tree
REQUEST_BYTES = 512 << 20  # of a request's body
KEPT_BYTES = 2 << 30  # of all the large arrays that a server keeps
ANSWER_BYTES = 1 << 31  # of an answer
ANSWER_LINE = 1 << 16  # bytes of a line that says how far a job is
CONNECTIONS = 64  # at a time
WAITING_JOBS = 32  # that wait or run
ASKED_GAUSSIANS = 500_000  # that one may ask a server for
