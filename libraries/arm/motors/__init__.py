"""Motor steps and speed limits of the joints."""
