"""Buttons, fields and colours that everything else in the window is made of."""
