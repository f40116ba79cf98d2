"""Arms that do not ship and problems for them, generated: how plans fare on an arm that nobody here drew."""
