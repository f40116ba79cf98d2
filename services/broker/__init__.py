"""The MQTT broker between gateway and device: the embedded one (native/), or mosquitto."""
