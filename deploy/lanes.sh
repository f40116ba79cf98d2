# The foreground of deploy/bootstrap while its lanes work: progress, interrupts, and at the end what has failed. Sourced.

declare -A titles=() # of the steps that have begun
running=()           # those that are under way
done_steps=0
beat=15 # [s] between two lines about what runs; on a terminal one line is written anew every second
[ ! -t 1 ] || beat=1
rewrite='' # takes that line back
(:) # bash learns the width of the terminal when a process ends
trap 'end_lanes 130' INT
trap 'end_lanes 143' TERM
trap 'end_lanes 129' HUP

# Tells how the lanes get on until all have ended; fails with what the failed steps have to say.
await_lanes() {
    local left=${#lanes[@]} last=$SECONDS failed='' words='' piece word name rest pid
    while [ "$left" -gt 0 ]; do
        if IFS= read -r -t 1 -u "$told" piece; then
            read -r word name rest <<<"$words$piece" && words=''
            hear "$word" "$name" "$rest"
        elif words+=$piece && [ -z "$(jobs -rp)" ]; then # the time may be over in the middle of a line
            break # one was killed before it could say that it ends
        fi
        [ $((SECONDS - last)) -lt "$beat" ] || { status && last=$SECONDS; }
    done
    line
    for pid in "${lanes[@]}"; do wait "$pid" || failed=yes; done
    trap - INT TERM HUP
    [ -z "$failed" ] || tell_failures
}

hear() {
    case $1 in
        begin) titles[$2]=$3 running+=("$2") && line "$bold==> $3$plain" ;;
        say) line "    $3" ;;
        done) leave "$2" && done_steps=$((done_steps + 1)) && line "    ${titles[$2]}: done in $3 s" ;;
        end) left=$((left - 1)) && lost "$2" ;;
    esac
}

# lost STEP: a lane has ended within it; or in none, where STEP is empty.
lost() {
    [ -n "$1" ] || return 0
    leave "$1"
    line "    ${red}${titles[$1]}: FAILED$plain${running[*]:+; the other steps go on}"
}

leave() {
    local each
    local -a others=()
    for each in "${running[@]}"; do [ "$each" = "$1" ] || others+=("$each"); done
    running=(${others[@]+"${others[@]}"})
}

# A line that stays, or none, in place of the one that is written anew.
line() { printf '%s%s' "$rewrite" "${1:+$1$'\n'}" && rewrite=''; }

# What runs, each with the last line of its output.
status() {
    local name last text="    $SECONDS s"
    local -a output
    [ ${#running[@]} != 0 ] || return 0
    for name in ${running[@]+"${running[@]}"}; do
        mapfile -t output <"$logs/$name"
        last=${output[*]: -1}
        text+=" | $name: ${last#"    "}"
    done
    if [ "$beat" = 1 ]; then
        printf '%s%s' "$rewrite" "${text:0:${COLUMNS:-80}-1}" && rewrite=$'\r\e[K'
    else
        say "$text"
    fi
}

# end_lanes CODE: ends every lane with all that it has started, and the bootstrap; what is there after 5 s is killed.
end_lanes() {
    local tries=0
    trap '' INT TERM HUP
    signal_lanes TERM || true
    while [ $tries -lt 50 ] && signal_lanes 0; do
        sleep 0.1
        tries=$((tries + 1))
    done
    signal_lanes KILL || true
    line
    printf '%sbootstrap: interrupted%s; what is done need not be done again\n' "$red" "$plain" >&2
    exit "$1"
}

# signal_lanes SIGNAL: to every process of every lane; fails where none is left.
signal_lanes() {
    local pid left=1
    for pid in "${lanes[@]}"; do ! kill "-$1" -- "-$pid" 2>/dev/null || left=0; done
    return $left
}

# The output and the words of every step that has failed; the same words once.
tell_failures() {
    local file words told_already=''
    for file in "$failures"/*; do
        [ -s "$file" ] || fail "a step was killed" "make setup again; the output of each step is in ${logs#"$root/"}"
        words=$(<"$file")
        case $told_already in *"$words"*) continue ;; esac
        told_already+=$words
        cat "$logs/${file##*/}" >&2
        printf '%s\n' "$words" >&2
    done
    exit 1
}

summary() {
    [ "$done_steps" = 0 ] && return 0
    say "${bold}ready.${plain} Start it with: make up     (or: source .venv/bin/activate && process-compose up)"
}
