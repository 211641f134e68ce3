"""The window: the only importers of ImGui and GLFW. No arithmetic about photos in here."""
