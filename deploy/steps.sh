# The steps of deploy/bootstrap: skipped when done, side by side in lanes, failing with a remedy. Sourced.

if [ -t 1 ]; then bold=$'\e[1m' red=$'\e[31m' plain=$'\e[0m'; else bold='' red='' plain=''; fi
logs=$state/logs       # what the commands of each step printed
failures=$state/failed # the sentence and the remedies of each step that has failed
current='' current_title=''
lanes=() # process groups

# A pipe that is never at its end: the lanes write "WORD STEP REST" into it, the foreground reads (lanes.sh).
exec {told}<> <(:)

tell() { printf '%s %s %s\n' "$1" "$current" "$2" >&"$told"; }

# say WORDS...: a line for the person.
say() { if [ -n "$current" ]; then tell say "$*"; else printf '%s\n' "$*"; fi; }

# fail WHAT REMEDY...: keeps what is wrong and every remedy, and ends this lane; outside of one says them and ends all.
fail() {
    local text
    text=$(printf '%s%s: %s%s\n' "$red" "${program:-bootstrap}" "$1" "$plain" && shift && printf '  remedy: %s\n' "$@")
    if [ -n "$current" ]; then printf '%s\n' "$text" >"$failures/$current"; else printf '%s\n' "$text" >&2; fi
    exit 1
}

# run COMMAND...: writes the command, then runs it.
run() {
    printf '    %s\n' "${*//"$root/"/}" >&2
    "$@"
}

# first_of NAME...: the path of the first that is an executable on PATH.
first_of() {
    local name
    for name in "$@"; do
        [ -n "$name" ] && type -P "$name" && return 0
    done
    return 1
}

# fingerprint WORDS FILE...: one hash of the words and of the files' names and contents.
fingerprint() { { printf '%s\n' "$1"; shift; [ $# = 0 ] || sha256sum -- "$@"; } | sha256sum | cut -d' ' -f1; }

# step NAME TITLE PRODUCT WORDS INPUT... -- FUNCTION: runs FUNCTION unless PRODUCT exists and WORDS and INPUTs are as then.
step() {
    local name=$1 title=$2 product=$3 words=$4 stamp started print
    local -a inputs=()
    stamp=$state/stamps/$name
    shift 4
    while [ "$1" != -- ]; do inputs+=("$1"); shift; done
    print=$(fingerprint "$words" ${inputs[@]+"${inputs[@]}"})
    if [ -e "$product" ] && [ -f "$stamp" ] && [ "$(<"$stamp")" = "$print" ]; then return 0; fi
    started=$SECONDS current=$name current_title=$title
    : >"$logs/$name"
    tell begin "$title"
    rm -f "$stamp"
    "$2" >"$logs/$name" 2>&1
    [ -e "$product" ] || fail "$title: $product is still missing" "deploy/bootstrap again; if it stays so, remove .venv and .gemelo first"
    printf '%s\n' "$print" >"$stamp"
    tell done "$((SECONDS - started))"
    current=''
}

# lane FUNCTION: runs its steps beside the other lanes, in a process group of its own, so that Ctrl-C ends all of it.
lane() {
    set -m
    (
        set +m
        trap end_of_lane EXIT
        "$1"
    ) </dev/null &
    set +m
    lanes+=($!)
}

# A step that this lane is still in has failed; where it has not said why, its output has.
end_of_lane() {
    [ -z "$current" ] || [ -s "$failures/$current" ] || (fail "$current_title: failed" "see its output above, then: make setup") || true
    tell end ''
}

# Two bootstraps at once would build into each other's folders.
one_at_a_time() {
    type -P flock >/dev/null || return 0
    exec 9>"$state/bootstrap.lock"
    flock -n 9 || { say "waiting for another deploy/bootstrap in this folder"; flock 9; }
}
