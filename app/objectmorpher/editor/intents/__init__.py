"""Intentions of the user, one file for each thing that they act on and a method per intention.

Panels, menu, shortcuts, tools and tests call these. They change the document through `edits` and
the history, and look things up in `derived`. No GL, no ImGui, no window in here.
"""
