"""Effects of the pointer in each tool. No GL, no ImGui, no window: tests drive them directly."""
