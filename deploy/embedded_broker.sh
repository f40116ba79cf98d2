# Building the embedded MQTT broker for deploy/bootstrap, as .gemelo/bin/gemelo-mqtt. Sourced.

broker_source=services/broker/native
broker_binary=$state/bin/gemelo-mqtt # services/broker/embedded.py

# All, or the extra `broker` where a host says what it needs: those of a site have mosquitto.
wants_embedded_broker() {
    [ -n "${EXTRAS+set}" ] || return 0
    case " $EXTRAS " in *" broker "*) ;; *) return 1 ;; esac
}

provide_embedded_broker() {
    by_go build_broker_by ||
        fail "the embedded MQTT broker could not be built" \
            "install Go 1.24 or newer, so that it is on PATH; without network access to Go's modules it cannot be built" \
            "or do without it: sudo apt-get install mosquitto; export EXTRAS=\"record planner view panel eyes\" GEMELO_MQTT_BROKER=mosquitto; make up"
}

build_broker_by() {
    say "building the embedded MQTT broker ($broker_source)"
    build_go "$1" "$root/$broker_source" "$broker_binary" '-gcflags=all=-dwarf=false' -ldflags '-s -w' . 2>&1 | counted 180
}
