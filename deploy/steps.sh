# The steps of deploy/bootstrap: said, timed, skipped when done, and failing with a remedy. Sourced.

if [ -t 1 ]; then bold=$'\e[1m' dim=$'\e[2m' red=$'\e[31m' plain=$'\e[0m'; else bold='' dim='' red='' plain=''; fi
done_steps=0

say() { printf '%s\n' "$*"; }

# fail WHAT REMEDY...: says what is wrong and every remedy, and ends.
fail() {
    printf '%sbootstrap: %s%s\n' "$red" "$1" "$plain" >&2
    shift
    printf '  remedy: %s\n' "$@" >&2
    exit 1
}

# run COMMAND...: shows the command dimly, then runs it.
run() {
    printf '%s    %s%s\n' "$dim" "${*//"$root/"/}" "$plain" >&2
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
    started=$SECONDS
    say "$bold==> $title$plain"
    rm -f "$stamp"
    "$2"
    [ -e "$product" ] || fail "$title: $product is still missing" "deploy/bootstrap again; if it stays so, remove .venv and .gemelo first"
    printf '%s\n' "$print" >"$stamp"
    done_steps=$((done_steps + 1))
    say "    done in $((SECONDS - started)) s"
}

# Two bootstraps at once would build into each other's folders.
one_at_a_time() {
    type -P flock >/dev/null || return 0
    exec 9>"$state/bootstrap.lock"
    flock -n 9 || { say "waiting for another deploy/bootstrap in this folder"; flock 9; }
}

summary() {
    [ "$done_steps" = 0 ] && return 0
    say "${bold}ready.${plain} Start it with: make up     (or: source .venv/bin/activate && process-compose up)"
}
