"""The arm and the objects as meshes and poses."""
