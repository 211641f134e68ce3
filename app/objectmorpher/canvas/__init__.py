"""The picture of a document on the canvas: computed, remembered by identity, never saved."""
