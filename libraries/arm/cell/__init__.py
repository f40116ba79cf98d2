"""The cell: cameras, things and places around the arm."""
