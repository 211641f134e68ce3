"""Dialogs, popups and the start screen."""
