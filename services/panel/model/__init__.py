"""The page's model: people's settings and the work under way; knows the arm by `gemelo` alone, and no browser."""
