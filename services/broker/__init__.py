"""The MQTT broker between gateway and device: amqtt in this process, or mosquitto in its place."""
