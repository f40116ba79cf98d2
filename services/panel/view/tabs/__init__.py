"""The tabs of the page, each for one browser."""
