"""Drawing with OpenGL 3.3: the only importers of moderngl."""
