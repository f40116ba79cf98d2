"""Commands of robot folders, kinematics and the scene."""
