"""The `gemelo` command: everything a person says to the twin from a terminal."""
