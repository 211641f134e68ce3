"""The window: its loop, its input, and its fixed parts."""
