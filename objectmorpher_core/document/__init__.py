"""The document, which is everything that is saved and undone, and its edits."""
