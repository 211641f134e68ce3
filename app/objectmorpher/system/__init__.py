"""The program and the system: its own files, logs, texts, first start."""
