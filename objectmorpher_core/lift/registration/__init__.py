"""Registration: an object from elsewhere is put where the photo shows it."""
