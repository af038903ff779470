#!/usr/bin/env bash
# A study as a Slurm array: sbatch --array=1-32 docs/study/slurm.sh paper.toml /shared/paper
# A task that runs out of time is queued again and continues; finished shards end at once.
#SBATCH --job-name=stylet-study
#SBATCH --array=1-8
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=1G
#SBATCH --time=04:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
# A minute before the end: rt-core keeps what is done and ends with 130.
#SBATCH --signal=B:TERM@60
set -uo pipefail
study=$1 out=$2

# bash runs a trap only between commands, so rt-core runs beside it.
"${RT_CORE:-rt-core}" study "$study" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
    --jobs "${SLURM_CPUS_PER_TASK:-1}" --out "$out" &
core=$!
trap 'kill -TERM "$core"' TERM
wait "$core"
code=$?
# The first wait ends with the signal; the second with the code of rt-core.
if [ "$code" -gt 128 ]; then
    wait "$core"
    code=$?
fi
if [ "$code" -eq 130 ]; then
    scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
    exit 0
fi
exit "$code"
