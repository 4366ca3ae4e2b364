#!/usr/bin/env bash
# Has a Slurm of its own (two nodes, both this machine) work on 20 small subjects with the script of `xavatar batch --emit slurm`. One gets
# the notice before its time is up, one is taken from its node and queued again, one has a broken frame, one node is lost: every other
# subject has to be complete, the totals right, and no step trained twice. Skipped where Slurm is missing (apt-get install slurm-wlm munge)
# or the user is not root, as whom Slurm's daemons run here.
set -euo pipefail
cd "$(dirname "$0")/.."

for program in slurmctld slurmd munged sbatch; do
    if ! PATH=$PATH:/usr/sbin command -v "$program" > /dev/null; then
        echo "skipped: $program is not installed (apt-get install slurm-wlm munge)"
        exit
    fi
done
if [ "$(id -u)" != 0 ]; then
    echo "skipped: Slurm's daemons are started as root here"
    exit
fi
PATH=$PATH:/usr/sbin

[ -n "${XAVATAR_BUILT-}" ] || cargo build --release --quiet
xavatar=${XAVATAR_BUILT-$PWD/target/release/xavatar}
folder=$(mktemp -d)
export SLURM_CONF=$folder/slurm.conf

# The processes that Slurm started on a node, and Slurm's own there.
processes_of() {
    # Of those that end meanwhile grep complains.
    { grep -lsz "^SLURM_CONF=$SLURM_CONF$" /proc/[0-9]*/environ || true; } | cut -d/ -f3 | while read -r process; do
        if grep -qsz -e "^SLURMD_NODENAME=$1$" -e "^XAVATAR_TEST_NODE=$1$" "/proc/$process/environ"; then
            echo "$process"
            # What watches over a task has written its title over its environment.
            parent=$(sed -n 's/^PPid:\t//p' "/proc/$process/status" 2> /dev/null || true)
            if grep -qs slurmstepd "/proc/$parent/comm"; then echo "$parent"; fi
        fi
    done | sort -u
}
end() {
    [ -z "${KEEP-}" ] || cp -r "$folder" "$KEEP"
    for file in "$folder"/*.pid; do
        if [ -s "$file" ]; then kill "$(cat "$file")" 2> /dev/null || true; fi
    done
    for node in one two; do kill -KILL $(processes_of $node) 2> /dev/null || true; done
    sleep 1
    rm -rf "$folder"
}
trap end EXIT

host=$(hostname -s)
mkdir -p "$folder"/{state,spool-one,spool-two,munge}
chmod 700 "$folder/munge"
dd if=/dev/urandom of="$folder/munge/key" bs=1024 count=1 status=none
chmod 400 "$folder/munge/key"
cat > "$SLURM_CONF" << CONFIGURATION
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
SlurmctldPort=16817
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool-%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd-%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SchedulerType=sched/builtin
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
SlurmdTimeout=6
KillWait=5
MinJobAge=600
NodeName=one,two NodeHostname=$host NodeAddr=127.0.0.1 Port=[16818-16819] CPUs=2
PartitionName=main Nodes=one,two Default=YES MaxTime=INFINITE State=UP
CONFIGURATION
munged --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munged.log" --seed-file="$folder/munge/seed"
slurmctld -f "$SLURM_CONF"
for node in one two; do XAVATAR_TEST_NODE=$node slurmd -N $node -f "$SLURM_CONF"; done

"$xavatar" --quiet demo --smoke --write-data "$folder/data" > /dev/null
cp -r "$folder/data" "$folder/broken"
truncate -s 1000 "$folder"/broken/train/Take1/meshes_ply/mesh-f00001.ply
bad=05 noticed=03 requeued=07 control=08
short=60 long=1500
{
    cat << 'HEAD'
body = "data/body"
preset = "demo"
stages = ["train"]
resolution = 48
[set]
"fields.geometry.width" = 16
"fields.geometry.grid.log2_entries" = 10
"fields.texture.width" = 16
"fields.texture.grid.log2_entries" = 10
"fields.skinning.spacing" = 0.12
"fields.skinning.fine_spacing" = 0.06
"sampling.points" = 200
"schedule.pretraining_steps" = 40
"schedule.checkpoint_steps" = 100
HEAD
    for number in $(seq -w 20); do
        case $number in $bad) data=broken ;; *) data=data ;; esac
        case $number in $noticed | $requeued | $control) steps=$long ;; *) steps=$short ;; esac
        printf '[[subject]]\nname = "s%s"\ndata = "%s"\nset = { "schedule.steps" = %d }\n' "$number" $data $steps
    done
} > "$folder/study.toml"
"$xavatar" batch "$folder/study.toml" --emit slurm > "$folder/study.sh"
begin=$(date +%s)
job=$(cd "$folder" && sbatch --parsable --cpus-per-task=1 --mem=0 --time=10 study.sh)

steps_of() { wc -l 2> /dev/null < "$folder/study/s$1/run/metrics.jsonl" || echo 0; }
# Waits until a subject is so far.
await() {
    for _ in $(seq 1200); do
        if [ "$(steps_of "$1")" -gt "$2" ]; then return; fi
        sleep 0.1
    done
    echo "failed: s$1 is not trained"
    tail "$folder"/study-*.log "$folder"/slurm*.log
    exit 1
}
task_of() { echo "${job}_$((10#$1 - 1))"; }
await $noticed 200
# It tries again while the task is being queued anew, which is what was wanted.
timeout 3 scancel --quiet --batch --signal=USR1 "$(task_of $noticed)" || true
await $requeued 200
scontrol requeue "$(task_of $requeued)"
await $control 100
# The other node is gone with all that runs on it; Slurm finds out by itself.
victims=$(processes_of two)
running=$(squeue --noheader --nodelist=two --format=%i | tr '\n' ' ')
# All at once: what watches over a task would tell that it was killed, and Slurm would take it for ended. Some may be over by now.
kill -STOP $victims 2> /dev/null || true
kill -KILL $victims 2> /dev/null || true
echo "node two is lost while it has task $running"
lost=$(date +%s)
while squeue --noheader --format=%T | grep -q .; do
    # What was taken off a node is begun again only after a while, which is Slurm's care for nodes that are broken.
    for task in $(squeue --noheader --states=PENDING --format='%i %r' | awk '$2 == "BeginTime" { print $1 }'); do
        scontrol update job="$task" StartTime=now > /dev/null 2>&1 || true
    done
    if [ $(($(date +%s) - lost)) -gt 900 ]; then
        squeue
        exit 1
    fi
    sleep 0.5
done
echo "all tasks ended after $(($(date +%s) - begin)) s"

"$xavatar" --quiet batch "$folder/study.toml" --status
"$xavatar" --quiet batch "$folder/study.toml" --status --json "$folder/status.json" > /dev/null
grep -A 7 '"totals"' "$folder/status.json" | tr -d ' \n' | grep -q '"subjects":20,"done":19,"failed":1,"running":0,"stopped":0,"waiting":0'
grep -q f00001 "$folder/study/s$bad/failed.json"
for number in $(seq -w 20); do
    if [ $number = $bad ]; then continue; fi
    case $number in $noticed | $requeued | $control) like=$control steps=$long ;; *) like=01 steps=$short ;; esac
    subject=$folder/study/s$number
    [ "$(steps_of $number)" = $((40 + steps)) ] || { echo "failed: s$number has made $(steps_of $number) steps"; exit 1; }
    [ "$(grep -c '"stage":"train","event":"ended"' "$subject/journal.jsonl")" = 1 ] || { echo "failed: s$number was trained twice"; exit 1; }
    cmp "$subject/run/avatar.safetensors" "$folder/study/s$like/run/avatar.safetensors"
done
grep -q '"stage":"train","event":"stopped"' "$folder/study/s$noticed/journal.jsonl"
restarts=$(for number in $noticed $requeued; do scontrol show job "$(task_of $number)" | grep -o 'Restarts=[0-9]*'; done | tr '\n' ' ')
echo "19 of 20 subjects complete, each step once, avatars as those of tasks left alone; $restarts"
