"""The editor without a window: its state, its history, and a method for each intention."""
