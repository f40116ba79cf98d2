"""What people at the page have set and what is under way; knows the arm by `gemelo` alone, and no browser."""
