"""Commands that move the arm, and those that stop it."""
