"""Figures of the planner: checks, kinematics, plans, their deadlines and their quality, beside other libraries."""
