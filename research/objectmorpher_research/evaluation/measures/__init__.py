"""The measures of two pictures, and of two sets of them, with the networks that they look by."""
