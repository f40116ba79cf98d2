"""Sentences of reasons: one catalogue of codes, in every language and for every front end."""
