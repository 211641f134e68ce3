"""The worker process and the threads that do what takes longer than a frame."""
