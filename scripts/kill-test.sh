#!/usr/bin/env bash
# Kills training, resumes it, and compares the avatar that it ends with, byte for byte, with that of a run that was left alone.
#   scripts/kill-test.sh [COUNT] [SEED]      COUNT kills at random moments [20]; 200 take some minutes
#   scripts/kill-test.sh --each-call COUNT WRITES [STEP]   kills at each of the first COUNT calls that make, rename, sync, lock or remove files, and
#                                                          at every STEP-th [1] of the first WRITES writes; needs strace
#   scripts/kill-test.sh --power-loss        lets the power fail after each call that changes a file or syncs it: what was not synced is lost, or
#                                            leaves zeros under its name (scripts/disk_states.py); needs strace and python3
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --quiet
xavatar=$PWD/target/release/xavatar
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$xavatar" --quiet demo --smoke --write-data "$folder/data" > /dev/null

# Small enough that a run takes seconds; with checkpoints often enough that kills hit them.
settings=(
    fields.geometry.width=16 fields.geometry.grid.log2_entries=10 fields.texture.width=16 fields.texture.grid.log2_entries=10
    fields.skinning.spacing=0.12 fields.skinning.fine_spacing=0.06
    sampling.points=200 schedule.pretraining_steps=9 schedule.checkpoint_steps=3
)
train() {
    local run=$1
    shift
    "$@" "$xavatar" --quiet --threads 2 train "$folder/data" --body "$folder/data/body" --out "$run" --preset demo --steps 12 \
        "${settings[@]/#/--set=}" ${resume:+--resume} > /dev/null 2> "$folder/said"
}
# A run that was killed before it had a configuration is started anew.
go_on() {
    resume=
    if [ -e "$1/config.toml" ]; then resume=yes; fi
    train "$@"
}
fail() {
    echo "failed: $1"
    cat "$folder/said"
    exit 1
}
compare() {
    cmp --silent "$folder/whole/avatar.safetensors" "$1/avatar.safetensors" || fail "the avatar of $1 is another one"
    [ -e "$1/report.html" ] || fail "$1 has no report"
    [ -z "$(find "$1" -name '.partial-*')" ] || fail "$1 has parts of files left in it"
}

begin=$(date +%s%3N)
resume='' train "$folder/whole" || fail "the run that is left alone"
duration=$(($(date +%s%3N) - begin))
echo "a run that is left alone takes $duration ms"

# How far a run is, by its files.
reached() {
    if [ -e "$1/avatar.safetensors" ]; then echo reporting
    elif [ -e "$1/checkpoints" ]; then echo training
    elif [ -e "$1/config.toml" ]; then echo preparing
    else echo starting; fi
}

if [ "${1-}" = --each-call ]; then
    kills=0
    # CALLS COUNT STEP
    kill_at_each() {
        local call run=$folder/run
        for ((call = 1; call <= $2; call += $3)); do
            rm -rf "$run"
            # strace ends as the program does that it starts.
            go_on "$run" strace -f -qq -o "$folder/calls" -e trace="$1" -e inject="$1:signal=KILL:when=$call" || kills=$((kills + 1))
            go_on "$run" || fail "resuming after a kill at call $call of $1: $(tail -n 1 "$folder/calls")"
            compare "$run"
        done
    }
    kill_at_each mkdir,rename,renameat,renameat2,unlink,ftruncate,fsync,fdatasync,flock "$2" 1
    kill_at_each write "$3" "${4-1}"
    echo "$kills kills, at each of $2 calls and at every ${4-1}. of $3 writes: all runs resumed and identical"
    exit
fi

if [ "${1-}" = --power-loss ]; then
    run=$folder/run
    changing=openat,mkdir,mkdirat,rename,renameat,renameat2,unlink,unlinkat,rmdir,ftruncate,write,pwrite64,writev,copy_file_range,sendfile
    resume='' train "$run" strace -f -qq -y -xx -s 268435456 -o "$folder/calls" -e trace="$changing",lseek,fsync,fdatasync,close
    python3 scripts/disk_states.py "$folder/calls" "$run" "$folder/states"
    states=0
    for state in "$folder"/states/*; do
        rm -rf "$run"
        if [ -e "$state/run" ]; then mv "$state/run" "$run"; fi
        go_on "$run" || fail "resuming from disk ${state##*/}"
        compare "$run"
        states=$((states + 1))
    done
    echo "$states disks as power losses may leave them: all runs resumed and identical"
    exit
fi

count=${1-20}
RANDOM=${2-1}
declare -A killed
kills=0 finished=0 run=$folder/run-0
while ((kills < count)); do
    # In the background the function's variables are the function's own.
    go_on "$run" exec &
    child=$!
    moment=$((RANDOM * duration / 32768))
    sleep "$((moment / 1000)).$(printf %03d $((moment % 1000)))"
    if kill -KILL "$child" 2> /dev/null; then
        kills=$((kills + 1)) phase=$(reached "$run")
        killed[$phase]=$((${killed[$phase]-0} + 1))
        wait "$child" 2> /dev/null || true
    else
        wait "$child" || fail "resuming $run after $kills kills"
    fi
    if [ -e "$run/report.html" ]; then
        compare "$run"
        rm -rf "$run"
        finished=$((finished + 1)) run=$folder/run-$((finished + 1))
    fi
done
go_on "$run" || fail "resuming $run at the end"
compare "$run"
echo "$kills kills ($(for phase in "${!killed[@]}"; do printf '%s %s ' "${killed[$phase]}" "$phase"; done)), $((finished + 1)) runs finished:" \
    "all resumed and identical"
