"""The words of the page, a table for each language."""
