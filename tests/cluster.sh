#!/usr/bin/env bash
# Runs the jobs of a small figure through a real Slurm (a cluster of one node that this script starts), through HyperQueue
# and through GNU parallel, and compares every byte with what one process gives. What is not installed is skipped, with
# the reason: slurm-wlm, munge and parallel are packages of Debian; for HyperQueue, hq or Python's package hyperqueue.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release
program="$PWD/target/release/gdg-tui"
work="$(mktemp -d)"
export XDG_STATE_HOME="$work" NO_COLOR=1
started=()
cleanup() {
    for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait 2>/dev/null || true
    rm -rf "$work"
}
trap cleanup EXIT

figure=(reproduce fig6 --max-updates 60 --seeds 2 --eval-tasks 1 --set hidden=16 --set buffer_size=20000
    --set candidates=50 --set learning_starts=200)
"$program" "${figure[@]}" --out "$work/alone" >/dev/null 2>&1

# Compares what was collected in a folder with what one process gave.
compare() {
    "$program" "${figure[@]}" --out "$work/$1" --collect >/dev/null 2>"$work/$1.err" ||
        { cat "$work/$1.err"; echo "$1: not all jobs are done"; exit 1; }
    for part in report.md data figures; do
        diff -r "$work/alone/$part" "$work/$1/$part" || { echo "$1: $part differs"; exit 1; }
    done
    echo "$1: $(wc -l <"$work/$1.jobs") jobs, the same bytes as one process alone"
}

list() { "$program" "${figure[@]}" --out "$work/$1" --list >"$work/$1.jobs" 2>/dev/null; }

# Prints the command of a job, given the folder and its number.
one() { echo "'$program' ${figure[*]} --out '$work/$1' --job $2"; }

slurm() {
    for tool in munged slurmctld slurmd sbatch; do
        if ! command -v "$tool" >/dev/null; then
            echo "slurm: skipped, $tool is not installed"
            return
        fi
    done
    local folder="$work/slurm-cluster" user host
    user="$(id -un)" host="$(hostname -s)"
    mkdir -m 755 "$folder" "$folder/state" "$folder/spool"
    head -c 1024 /dev/urandom >"$folder/munge.key"
    chmod 400 "$folder/munge.key"
    munged --foreground --force --socket="$folder/munge.socket" --key-file="$folder/munge.key" \
        --pid-file="$folder/munge.pid" --seed-file="$folder/munge.seed" --log-file="$folder/munge.log" \
        >"$folder/munged.out" 2>&1 &
    started+=($!)
    cat >"$folder/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$folder/munge.socket
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
    export SLURM_CONF="$folder/slurm.conf"
    for _ in $(seq 50); do [ -S "$folder/munge.socket" ] && break; sleep 0.2; done
    slurmctld -D -c >"$folder/slurmctld.out" 2>&1 &
    started+=($!)
    slurmd -D >"$folder/slurmd.out" 2>&1 &
    started+=($!)
    for _ in $(seq 100); do
        sinfo -h -o %T 2>/dev/null | grep -q idle && break
        sleep 0.3
    done
    if ! sinfo -h -o %T 2>/dev/null | grep -q idle; then
        echo "slurm: skipped, its node does not come up here: $(tail -n 2 "$folder"/slurm*.log | tr '\n' ' ')"
        return
    fi
    list slurm
    # As in docs/experiments.md.
    (cd "$work" && sbatch --wait --output=/dev/null --array="1-$(wc -l <slurm.jobs)" \
        --wrap "$(one slurm '$SLURM_ARRAY_TASK_ID')" >/dev/null)
    compare slurm
}

hyperqueue() {
    list hyperqueue
    if command -v hq >/dev/null; then
        export HQ_SERVER_DIR="$work/hq"
        hq server start >"$work/hq.out" 2>&1 &
        started+=($!)
        for _ in $(seq 50); do hq server info >/dev/null 2>&1 && break; sleep 0.2; done
        hq worker start >"$work/hq-worker.out" 2>&1 &
        started+=($!)
        # As in docs/experiments.md.
        (cd "$work" && hq submit --wait --stdout=none --stderr=none --array "1-$(wc -l <hyperqueue.jobs)" -- \
            sh -c "$(one hyperqueue '$HQ_TASK_ID')" >/dev/null)
        compare hyperqueue
    elif "${PYTHON:-python3}" -c 'import hyperqueue' 2>/dev/null; then
        (cd "$work" && ONE="$(one hyperqueue '')" TMPDIR="$work" "${PYTHON:-python3}" - >"$work/hq.out" 2>&1 <<'PYTHON'
import os

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

with LocalCluster() as cluster:
    cluster.start_worker(WorkerConfig(cores=2))
    client, job = cluster.client(), Job()
    for number, _ in enumerate(open("hyperqueue.jobs"), 1):
        job.program(["sh", "-c", os.environ["ONE"] + str(number)], stdout=None, stderr=None)
    client.wait_for_jobs([client.submit(job)])
PYTHON
        )
        compare hyperqueue
    else
        echo "hyperqueue: skipped, neither hq nor Python's package hyperqueue is installed"
    fi
}

gnu_parallel() {
    if ! command -v parallel >/dev/null; then
        echo "parallel: skipped, it is not installed"
        return
    fi
    list parallel
    seq "$(wc -l <"$work/parallel.jobs")" | parallel --jobs 2 "$(one parallel '{}')" >/dev/null 2>&1
    compare parallel
}

slurm
hyperqueue
gnu_parallel
