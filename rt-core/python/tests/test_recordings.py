"""Recordings and flights as arrays: beside the `mcap` package, beside each other, and a study's Parquet beside pyarrow."""

import base64
import json
import os
import pathlib
import signal
import subprocess
import time
from collections import defaultdict

import numpy as np
import pytest
import stylet
from conftest import ROOT, same_bits

EXAMPLE = ROOT / "host-ui/example/insertion.mcap"


def by_mcap(path):
    """Returns the messages of each topic, by the package of Foxglove, and the time of the first tick, ns."""
    from mcap.reader import make_reader

    messages = defaultdict(list)
    with open(path, "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            messages[channel.topic].append((message.log_time, json.loads(message.data)))
    return messages, messages["/stylet/tick"][0][0]


def test_a_recording_is_that_of_another_reader():
    messages, begun_ns = by_mcap(EXAMPLE)
    ours = stylet.read_recording(EXAMPLE)
    ticks = [message for _, message in messages["/stylet/tick"]]
    assert len(ticks) > 5_000 and ours["cut_off"] is None
    scaled = {"tip_mm": ("tip_in_scene_m", 1e3), "past_membrane_mm": ("depth_m", 1e3)}
    scaled |= {"speed_mm_per_s": ("speed_m_per_s", 1e3), "tool": ("world_from_tool", 1.0)}
    scaled |= {"force_n": ("force_on_hand_n", 1.0), "terms_n": ("force_terms_n", 1.0)}
    for name, (key, factor) in scaled.items():
        assert same_bits(ours["ticks"][name], np.array([tick[key] for tick in ticks]) * factor), name
    for name in ("tick", "phase", "fault", "flags", "buttons", "tissue_tick", "missed", "wake_latency_ns", "work_ns"):
        assert np.array_equal(ours["ticks"][name], [tick[name] for tick in ticks]), name
    times_s = [(time_ns - begun_ns) * 1e-9 for time_ns, _ in messages["/stylet/tick"]]
    assert np.allclose(ours["ticks"]["time_s"], times_s, rtol=0.0, atol=1e-12)
    events = ours["events"]
    theirs = [event for _, event in messages["/stylet/event"]]
    assert events["kind"] == [event["kind"] for event in theirs]
    assert same_bits(events["position_mm"], np.array([event["position_m"] for event in theirs]) * 1e3)
    snapshots = ours["snapshots"]
    surface = [base64.b64decode(gland["data"]) for _, gland in messages["/stylet/gland"]]
    surface = np.array([np.frombuffer(data, "<f4").reshape(-1, 3) for data in surface])
    assert snapshots["surface_mm"].shape == surface.shape == (len(surface), len(snapshots["rest_mm"]), 3)
    assert same_bits(snapshots["surface_mm"], surface * np.float32(1e3))
    assert snapshots["triangles"].max() < len(snapshots["rest_mm"])


def test_a_recording_tells_the_insertion():
    ours = stylet.read_recording(EXAMPLE)
    assert ours["events"]["kind"].count("SeedDropped") == len(ours["seeds_mm"]) == len(ours["planned_mm"]) == 5
    assert ours["snapshots"]["seeds"][-1] == 5
    assert np.allclose(np.linalg.norm(ours["axes"], axis=1), 1.0)
    assert ours["ticks"]["phase"].max() >= 2 and np.linalg.norm(ours["ticks"]["force_n"], axis=1).max() > 1.0
    keys = [parameter.key for parameter in stylet.parameters()]
    assert list(ours["parameters"]) == keys
    assert len(ours["second"]["tick"]) == 0 and ours["second"]["torque_nm"].shape == (0, 3)


def test_what_is_wrong_with_a_recording_is_said(tmp_path):
    short = tmp_path / "short.mcap"
    short.write_bytes(EXAMPLE.read_bytes()[: EXAMPLE.stat().st_size // 2])
    ours = stylet.read_recording(short)
    assert ours["cut_off"] and 0 < len(ours["ticks"]["tick"])
    other = tmp_path / "other"
    other.write_bytes(b"nothing")
    with pytest.raises(ValueError, match="other: it is no recording"):
        stylet.read_recording(other)
    with pytest.raises(ValueError, match="other: not a flight recording"):
        stylet.read_flight(other)
    other.write_bytes(b"STYFLT\0\x01" + bytes(100))
    with pytest.raises(ValueError, match="layout 1"):
        stylet.read_flight(other)
    with pytest.raises(ValueError, match="missing.mcap"):
        stylet.read_recording("missing.mcap")


def test_a_flight_and_a_recording_of_one_run_hold_the_same_ticks(tmp_path):
    programs = pathlib.Path(os.environ.get("STYLET_PROGRAMS", ""))
    if not (programs / "rt-core").exists():
        pytest.skip("STYLET_PROGRAMS names no folder of programs; make python-test does, and make build fills it")
    named = ["--instance", f"python{os.getpid()}"]
    core = subprocess.Popen([programs / "rt-core", *named, "--no-rt", "--flight-dir", tmp_path], stdout=subprocess.DEVNULL)
    try:
        record = [programs / "host-ui", "record", *named, "--out", tmp_path / "run.mcap"]
        until = time.monotonic() + 30
        while subprocess.run([*record, "--duration", "0.1"], capture_output=True).returncode != 0:
            assert time.monotonic() < until, "no core"
        recorder = subprocess.Popen([*record, "--duration", "3"], stdout=subprocess.DEVNULL)
        time.sleep(2.0)
        subprocess.run([programs / "host-ui", "flight", *named], check=True, stdout=subprocess.DEVNULL)
        recorder.wait(30)
    finally:
        core.send_signal(signal.SIGTERM)
        core.wait(30)
    flights = [stylet.read_flight(path) for path in sorted(tmp_path.glob("*.flight"))]
    recorded, flown = stylet.read_recording(tmp_path / "run.mcap")["ticks"], flights[0]["ticks"]
    shared, here, there = np.intersect1d(recorded["tick"], flown["tick"], return_indices=True)
    assert len(shared) > 500, (len(recorded["tick"]), len(flown["tick"]))
    for name in set(recorded) - {"time_s"}:
        assert same_bits(recorded[name][here], flown[name][there]), name
    assert np.ptp(recorded["time_s"][here] - flown["time_s"][there]) < 1e-9
    assert len(flights) == 2 and all(flight["reason"] for flight in flights), "on request, and at the end"
    tissue = flights[0]["tissue"]
    assert tissue["tip_mm"].shape == tissue["displacement_mm"].shape == (len(tissue["time_s"]), 3)
    assert len(tissue["time_s"]) > 100 and flights[0]["period_s"] == 1e-3


def test_the_parquet_file_of_a_study_opens_as_it_is(tmp_path):
    from pyarrow import parquet

    head, *needles = (ROOT / "docs/study/paper-plan.toml").read_text().split("[[needle]]")
    (tmp_path / "plan.toml").write_text("[[needle]]".join([head, *needles[:2]]))
    gland = '[[gland]]\nscene = "paper"\nplan = "plan.toml"\n'
    (tmp_path / "two.toml").write_text(f'name = "two"\nimplants = 1\nlinear = true\n{gland}[vary]\n')
    ours = stylet.study(tmp_path / "two.toml", tmp_path / "out")
    (file,) = (tmp_path / "out").rglob("*.parquet")
    theirs = parquet.read_table(file)
    shared = set(theirs.column_names) & set(ours["insertions"])
    assert {"hole", "peak_force_n"} <= shared
    for name in shared:
        column, mine = theirs.column(name).to_pylist(), ours["insertions"][name]
        assert list(mine) == column if isinstance(mine, list) else np.array_equal(mine, column, equal_nan=True), name
