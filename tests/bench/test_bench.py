#!/usr/bin/env python3
"""The benchmark's file keeps its contract: a few frames through the program, and every number of bench.json looked at.

    test_bench.py PROGRAM
"""
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
OBLIGATORY = {
    "sad_dense_vga64": 13, "sad_5pct_vga64": 140, "robust_vs_sgbm3way": 8, "pipeline_thesis_vga64": 13,
    "pipeline_robust_vga64": 22, "pipeline_thesis_1280x128": 13, "pipeline_robust_1280x128": 22,
}
STAGES = ["ingest", "foreground", "disparity", "shadow", "objects", "tracking", "background"]


def run(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, check=False, timeout=800)


class Contract(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "bench.json")
            cls.done = run("--quick", "--frames", "3", "--warm-up", "2", "--markdown", "--json", str(file))
            assert cls.done.returncode == 0, cls.done.stderr
            cls.report = json.loads(file.read_text())
        cls.entries = {entry["name"]: entry for entry in cls.report["entries"]}

    def assert_positive(self, value, what):
        self.assertIsInstance(value, (int, float), what)
        self.assertTrue(math.isfinite(value) and value > 0, f"{what}: {value}")

    def assert_ordered(self, times, what):
        # A stage that does nothing may take less than the clock's step.
        self.assertTrue(0 <= times["p50"] <= times["p99"] <= times["max"] < math.inf, f"{what}: {times}")

    def test_obligatory_entries_are_there_with_their_targets(self):
        for name, target in OBLIGATORY.items():
            self.assertIn(name, self.entries)
            self.assertEqual(self.entries[name]["target"], target, name)

    def test_names_are_unique(self):
        self.assertEqual(len(self.entries), len(self.report["entries"]))

    def test_every_entry_has_finite_medians_and_their_ratio(self):
        for name, entry in self.entries.items():
            self.assertEqual(entry["unit"], "ms", name)
            for side in ("ours", "theirs"):
                self.assert_positive(entry[side], f"{name} {side}")
                detail = entry["detail"][side]
                self.assertEqual(detail["p50"], entry[side], name)
                self.assert_ordered(detail, name)
                self.assert_ordered(detail["wall"], name)
                # One thread cannot have the CPU for longer than the clock on the wall says.
                self.assertLessEqual(detail["max"], detail["wall"]["max"] * 1.02 + 0.1, name)
                self.assert_positive(detail["gb_per_s"], name)
                self.assertAlmostEqual(detail["gb_per_s"] * entry[side] * 1e6 / entry["bytes"], 1, 6, name)
            self.assertAlmostEqual(entry["ratio"] * entry["ours"] / entry["theirs"], 1, 9, name)

    def test_ours_takes_nothing_from_the_heap_and_theirs_is_counted(self):
        for name, entry in self.entries.items():
            ours, theirs = (entry["detail"][side]["allocations"] for side in ("ours", "theirs"))
            if ours is None:
                self.skipTest("a sanitizer's malloc is not counted")
            self.assertEqual(ours, 0, name)
            self.assertGreater(theirs, 0, name)

    def test_stages_add_up_to_the_whole(self):
        pipelines = [e for e in self.entries.values() if "stages" in e]
        self.assertGreaterEqual(len(pipelines), 4)
        for entry in pipelines:
            self.assertEqual([row["name"] for row in entry["stages"]], STAGES)
            for row in entry["stages"] + entry["calls"]:
                for side in ("ours", "theirs"):
                    if row[side] is not None:
                        self.assert_ordered(row[side], f"{entry['name']} {row['name']}")
            # A sum is never over the sum of the largest.
            for side in ("ours", "theirs"):
                whole = sum(row[side]["max"] for row in entry["stages"] if row[side] is not None)
                self.assertGreaterEqual(whole * 1.05, entry[side], f"{entry['name']} {side}")

    def test_each_simd_target_was_forced_and_equals_the_naive_result(self):
        forced = [n.removeprefix("sad_dense_vga64_") for n in self.entries if n.startswith("sad_dense_vga64_")]
        self.assertIn("scalar", forced)
        self.assertEqual(forced[-1], self.report["machine"]["simd"])
        checked = " ".join(self.report["equal_to_naive"])
        for target in forced:
            self.assertIn(f"on {target}", checked)

    def test_machine_and_rival_are_named(self):
        for key in ("name", "cpu", "kernel", "compiler", "build_type", "simd"):
            self.assertTrue(self.report["machine"][key], key)
        self.assertGreaterEqual(self.report["machine"]["cores"], 1)
        self.assert_positive(self.report["machine"]["copy_gb_per_s"], "copy")
        self.assertRegex(self.report["opencv"]["version"], r"^\d+\.\d+\.\d+")
        self.assertIn("baseline", self.report["opencv"]["build"])
        self.assertNotIn("baseline none", self.report["opencv"]["build"])
        self.assertEqual(self.report["opencv"]["threads"], 1)

    def test_instructions_are_counted_or_the_reason_is_told(self):
        counted = [e["detail"]["ours"]["instructions"] for e in self.entries.values()]
        if self.report["instructions"]["by"] is None:
            self.assertTrue(self.report["instructions"]["note"])
            self.assertEqual(set(counted), {None})
        else:
            for count in counted:
                self.assert_positive(count, "instructions")

    def test_scaling_is_dearest_over_cheapest(self):
        names = {s["name"] for s in self.report["scaling"]}
        self.assertEqual(names, {"cost_a_pixel_thesis", "cost_a_pixel_robust", "objects_thesis", "objects_robust"})
        for scaling in self.report["scaling"]:
            values = scaling["values"].values()
            for value in values:
                self.assert_positive(value, scaling["name"])
            self.assertAlmostEqual(scaling["growth"], max(values) / min(values), 9)
            self.assertIn(scaling["limit"], (1.25, 2))

    def test_the_page_holds_every_entry_and_table_lines_are_whole(self):
        page = self.done.stdout
        self.assertRegex(page, r"^## \d{4}-\d\d-\d\d\n")
        for name in self.entries:
            self.assertIn(f"| {name} ", page)
        for table in re.findall(r"(?:^\|.*\|\n)+", page, re.M):
            self.assertEqual(len({line.count("|") for line in table.splitlines()}), 1, table)


class Command(unittest.TestCase):
    def test_bad_usage_is_2(self):
        self.assertEqual(run("--frames", "0").returncode, 2)
        self.assertEqual(run("--nonsense").returncode, 2)
        self.assertEqual(run("--help").returncode, 0)

    def test_a_file_that_cannot_be_written_is_told_at_once(self):
        start = time.monotonic()
        done = run("--json", "no/such/folder/bench.json")
        self.assertEqual(done.returncode, 1)
        self.assertIn("no/such/folder/bench.json", done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1)
        self.assertLess(time.monotonic() - start, 5)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
