"""Images of cameras, real and virtual."""
