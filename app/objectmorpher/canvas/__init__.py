"""What the canvas shows of a document: computed from it, remembered by identity, never saved."""
