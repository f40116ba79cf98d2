"""Forward kinematics, Jacobians and self-collisions."""
