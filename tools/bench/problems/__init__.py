"""The fixed random planning problems: data, loader, and the program that made them."""
