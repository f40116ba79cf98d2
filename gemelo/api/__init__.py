"""The Python interface of gemelo, whose public names `gemelo` itself has."""
