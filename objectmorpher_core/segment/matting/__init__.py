"""From a hard mask to a soft cut-out: the outline, alpha, and the colours of the object itself."""
