"""Reasons why something is not so: codes with values, and one catalogue of their sentences in every language."""

from gemelo.schemas.reasons.reason import Reason, Remedy, because, plain, remedy
from gemelo.schemas.reasons.sentences import PLAIN, FrontEnd, Value, say, say_apart

__all__ = ["PLAIN", "FrontEnd", "Reason", "Remedy", "Value", "because", "plain", "remedy", "say", "say_apart"]
