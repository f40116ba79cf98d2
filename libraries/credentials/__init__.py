"""Certificates and files of secrets, for broker and bus alike."""
