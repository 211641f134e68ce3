"""ObjectMorpher."""
