"""The page of `objectmorpher evaluate study`: served to browsers, without a window of our own."""
