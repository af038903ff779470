#!/usr/bin/env python3
"""Rows of all shards in a folder as one SHA-256, by polars: whatever the shards, the same rows give the same number."""

import hashlib
import sys

import polars

rows = polars.read_parquet(f"{sys.argv[1]}/shard-*.parquet").sort("id")
print(hashlib.sha256(rows.write_ndjson().encode()).hexdigest())
