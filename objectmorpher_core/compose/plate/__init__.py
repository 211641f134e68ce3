"""The plate: the photo with the hole behind its objects filled in."""
