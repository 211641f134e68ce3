"""An edit as a script: its options, the runner, and what it writes."""
