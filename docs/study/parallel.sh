#!/usr/bin/env bash
# A study in shards on one machine, or on several that see the same folder, by GNU parallel.
#   docs/study/parallel.sh paper.toml out/paper            # on this machine
#   SSH=node1,node2 docs/study/parallel.sh paper.toml /shared/paper
# Started again after any interruption it skips what is finished.
set -euo pipefail
study=$1 out=$2 shards=${SHARDS:-16} core=${RT_CORE:-rt-core}
parallel ${SSH:+--sshlogin "$SSH" --workdir .} --jobs "${JOBS:-100%}" --halt soon,fail=1 --line-buffer --tagstring 'shard {}' \
    "$core" study "$study" --shard "{}/$shards" --jobs 1 --out "$out" ::: $(seq "$shards")
