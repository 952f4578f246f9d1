#!/usr/bin/env python3
"""Counts on 64-bit ARM are the same twice, and hang together.

    test_count_aarch64.py NATIVE_PROGRAM EMULATED_PROGRAM SYSROOT PLUGIN
"""
import json
import pathlib
import subprocess
import sys
import tempfile

script = pathlib.Path(__file__).with_name("count_aarch64.py")


def count(folder):
    file = pathlib.Path(folder) / "count.json"
    native, emulated, sysroot, plugin = sys.argv[1:5]
    subprocess.run([sys.executable, script, "--native", native, "--emulated", emulated, "--sysroot", sysroot,
                    "--plugin", plugin, "--warm-up", "2", "--frames", "1", "--json", file], check=True)
    return json.loads(file.read_text())


with tempfile.TemporaryDirectory() as temporary:
    first, second = count(temporary), count(temporary)
assert first == second, "two counts of the same work differ"
assert first["simd"] == "neon", first["simd"]
work = first["work"]
for whole in ("sad_dense", "census_dense", "thesis", "robust", "robust_as_shipped"):
    row = work[whole]
    assert row["instructions"] > 1e6 and row["instructions"] > row["simd"] > 0 and row["memory"] > 0, (whole, row)
    for low, high in (row["A72"], row["A76"]):
        assert 0 < low < high, (whole, row)
for whole in ("thesis", "robust", "robust_as_shipped"):
    stages = [row["instructions"] for name, row in work.items() if name.startswith(whole + "/")]
    assert len(stages) == 8 and sum(stages) == work[whole]["instructions"], (whole, stages)
# The dense map of the thesis preset is made by the same matcher.
assert work["thesis/disparity"]["instructions"] > 0.9 * work["sad_dense"]["instructions"], work["thesis/disparity"]
