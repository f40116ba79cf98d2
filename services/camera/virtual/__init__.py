"""A camera that renders the cell, with exact ground truth."""
