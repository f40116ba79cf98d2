"""The wires to the device: the only modules that know one."""
