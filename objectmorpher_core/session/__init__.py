"""Sessions (.omorph) and the journal that survives a crash."""
