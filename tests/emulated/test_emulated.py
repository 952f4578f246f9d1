#!/usr/bin/env python3
"""emulated.py runs what is not left out and tells what was, with a stand-in for a program of GoogleTest."""
import os
import pathlib
import stat
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).with_name("emulated.py")
# Lists A.Good, A.Bad, P/B.Good/0; obeys a filter; A.Bad fails, A.Skips skips itself.
PROGRAM = """#!/usr/bin/env python3
import os, re, sys
names = os.environ["TESTS"].split()
options = dict(word[2:].split("=", 1) for word in sys.argv[1:] if "=" in word)
if "--gtest_list_tests" in sys.argv:
    print("Running main() from gtest_main.cc")
    for suite in dict.fromkeys(name.rsplit(".", 1)[0] for name in names):
        print(suite + ".")
        for name in names:
            if name.startswith(suite + "."):
                print("  " + name.rsplit(".", 1)[1] + "  # GetParam() = 1")
    sys.exit()
out = set(options["gtest_filter"].partition("-")[2].split(":"))
run = [name for name in names if name not in out]
if "Crash" in os.environ["TESTS"]:
    os.abort()
with open(options["gtest_output"][4:], "w") as file:
    file.write("<testsuites><testsuite>")
    for name in run:
        suite, test = name.rsplit(".", 1)
        inner = {"Bad": "<failure/>", "Skips": '<skipped message="a.cpp:1&#10;no reason at all"/>'}.get(test, "")
        file.write(f'<testcase classname="{suite}" name="{test}" time="0.5">{inner}</testcase>')
    file.write("</testsuite></testsuites>")
sys.exit(1 if "A.Bad" in run else 0)
"""


class Emulated(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = pathlib.Path(self.folder.name)
        self.program = self.root / "program"
        self.program.write_text(PROGRAM)
        self.program.chmod(self.program.stat().st_mode | stat.S_IXUSR)

    def call(self, verb, left_out, *words, tests="", strict="1"):
        (self.root / "left_out.txt").write_text(left_out)
        env = {**os.environ, "TESTS": tests, "STEREOTRACK_STRICT_SKIPS": strict, "CI": ""}
        done = subprocess.run([sys.executable, SCRIPT, verb, "--results", self.root / "results", "--left-out",
                               self.root / "left_out.txt", *words], capture_output=True, text=True, env=env)
        return done.returncode, done.stdout + done.stderr

    def run_and_report(self, tests, left_out="", strict="1"):
        code, _ = self.call("run", left_out, self.program, "env", "-", f"TESTS={tests}", f"PATH={os.environ['PATH']}",
                            tests=tests)
        return code, *self.call("report", left_out, strict=strict)

    def test_all_that_passes_is_counted(self):
        ran, code, said = self.run_and_report("A.Good P/B.Good/0")
        self.assertEqual((ran, code), (0, 0), said)
        self.assertIn("2 tests passed, 0 failed, 0 skipped, 0 left out", said)

    def test_a_failure_fails_both(self):
        ran, code, said = self.run_and_report("A.Good A.Bad")
        self.assertEqual((ran, code), (1, 1))
        self.assertIn("failed A.Bad", said)

    def test_what_is_left_out_does_not_run_and_is_told(self):
        ran, code, said = self.run_and_report("A.Good A.Bad P/B.Good/0", "A[.]Bad | it is bad\nP/.* | so is this\n")
        self.assertEqual((ran, code), (0, 0), said)
        self.assertIn("1 tests passed, 0 failed, 0 skipped, 2 left out", said)
        self.assertIn("left out 1: A[.]Bad: it is bad", said)

    def test_a_line_that_leaves_out_nothing_is_an_error(self):
        self.assertEqual(self.run_and_report("A.Good", "A[.]Gone | why\n")[1], 1)

    def test_a_line_without_a_reason_is_refused(self):
        self.assertEqual(self.run_and_report("A.Good", "A[.]Good\n")[:2], (1, 1))

    def test_a_program_of_which_all_is_left_out_must_be_named_itself(self):
        self.assertEqual(self.run_and_report("A.Good", ".* | why\n")[0], 1)

    def test_a_skip_is_told_and_fails_where_skips_are_counted(self):
        ran, code, said = self.run_and_report("A.Good A.Skips", strict="")
        self.assertEqual((ran, code), (0, 0), said)
        self.assertIn("skipped A.Skips: no reason at all", said)
        self.assertEqual(self.run_and_report("A.Good A.Skips")[1], 1)

    def test_a_program_that_crashes_fails(self):
        ran, code, said = self.run_and_report("A.Crash")
        self.assertEqual((ran, code), (1, 1), said)
        self.assertIn("program did not reach its end", said)

    def test_nothing_at_all_is_no_success(self):
        self.assertEqual(self.call("report", "")[0], 1)


if __name__ == "__main__":
    unittest.main()
