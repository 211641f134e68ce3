"""Light, grain and focus of a moved object."""
