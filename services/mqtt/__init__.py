"""How gateway and device join an MQTT broker: address, password, TLS, the sentence where they cannot, and its lock."""
