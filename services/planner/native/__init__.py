"""The native planner: collision checks and path search in C++, for any arm that is read at run time.

Lengths in m, angles in rad, everything in the arm's base frame; joint values (n,) or (rows, n) in the arm's order.
Importing `binding` raises `NativeMissing`, an ImportError, where the C++ module has not been built.
"""
