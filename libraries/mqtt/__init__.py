"""Joining an MQTT broker, for gateway and device: address, password, TLS, a sentence for each failure, the lock."""
