# To be sourced. alone LOCK: waits until nobody else has it, and has it until the script's end; without flock nobody waits.
alone() {
    command -v flock >/dev/null || return 0
    exec 8>"$1"
    flock 8
}
