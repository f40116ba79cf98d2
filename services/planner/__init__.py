"""Goals in, verified and timed trajectories out, or a refusal that explains itself."""
