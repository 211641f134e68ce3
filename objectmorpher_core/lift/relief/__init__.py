"""The embedded lifter: a closed shape from one silhouette and what networks see inside it."""
