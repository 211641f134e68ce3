"""Where the program meets the system: its own files, logs, texts, first start."""
