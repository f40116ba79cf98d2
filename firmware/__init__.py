"""The device's Python side: bindings of the core, and the virtual ESP32."""
