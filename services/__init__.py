"""The processes of the twin and the libraries that they share: one folder each."""
