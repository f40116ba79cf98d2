"""The page as viser draws it: one world for all browsers, and for each its own controls in its own language."""
