"""What the pointer does in each tool. No GL, no ImGui, no window: tests drive these directly."""
