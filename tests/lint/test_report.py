#!/usr/bin/env python3
"""report_tests.py refuses what would pass only because it did not run. The reports are as ctest 3.25 writes them."""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parent / "report_tests.py"
PASSED = '<testcase name="A.Passes" status="run"><system-out>ok</system-out></testcase>'
FAILED = '<testcase name="A.Fails" status="fail"><failure message=""/><system-out/></testcase>'
DISABLED = '<testcase name="A.Off" status="disabled"><disabled message=""/><system-out/></testcase>'


def skipped(name, reason):
    return (f'<testcase name="{name}" status="notrun"><skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/><system-out>'
            f"[ RUN      ] {name}\nx_test.cpp:3: Skipped\n{reason}\n[  SKIPPED ] {name} (0 ms)\n</system-out></testcase>")


class Report(unittest.TestCase):
    def report(self, *cases, strict=False, data=False, expected="A.Net | no IPv6 | its IPv4 twin runs\n"):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "c.xml").write_text(f'<testsuite name="x">{"".join(cases)}</testsuite>')
            (root / "expected.txt").write_text("# comment\n" + expected)
            if data:
                (root / "shared/data").mkdir(parents=True)
            env = {k: v for k, v in os.environ.items() if k not in ("CI", "STEREOTRACK_STRICT_SKIPS")}
            if strict:
                env["CI"] = "true"
            done = subprocess.run([sys.executable, SCRIPT, root / "c.xml", root / "expected.txt", "--data",
                                   root / "shared/data"], capture_output=True, text=True, env=env, check=False)
        return done.returncode, done.stdout + done.stderr

    def test_counts(self):
        code, text = self.report(PASSED, PASSED, skipped("A.Net", "no IPv6 here"))
        self.assertEqual(code, 0)
        self.assertIn("3 in all, 2 passed, 0 failed, 1 skipped", text)
        self.assertIn("skipped A.Net: no IPv6 here", text)

    def test_a_failure_fails(self):
        self.assertEqual(self.report(PASSED, FAILED)[0], 1)

    def test_a_disabled_test_fails(self):
        self.assertEqual(self.report(PASSED, DISABLED)[0], 1)

    def test_nothing_run_fails(self):
        self.assertEqual(self.report()[0], 1)
        self.assertEqual(self.report(skipped("A.Net", "no IPv6 here"))[0], 1)

    def test_strict_takes_only_the_skips_that_are_named_with_their_reason(self):
        self.assertEqual(self.report(PASSED, skipped("A.Net", "no IPv6 here"), strict=True)[0], 0)
        self.assertEqual(self.report(PASSED, skipped("A.Net", "too slow today"), strict=True)[0], 1)
        self.assertEqual(self.report(PASSED, skipped("A.NetTwo", "no IPv6 here"), strict=True)[0], 1)

    def test_missing_data_is_told_and_refused_where_strict(self):
        case = skipped("A.Real", "no test data: ../shared/data/x")
        code, text = self.report(PASSED, case)
        self.assertEqual(code, 0)
        self.assertIn("NOT tested", text)
        self.assertEqual(self.report(PASSED, case, strict=True)[0], 1)

    def test_data_that_is_there_is_no_reason_to_skip(self):
        self.assertEqual(self.report(PASSED, skipped("A.Real", "no test data: ../shared/data/x"), data=True)[0], 1)

    def test_an_expected_skip_owes_its_why(self):
        self.assertNotEqual(self.report(PASSED, expected="A.Net | no IPv6\n")[0], 0)


if __name__ == "__main__":
    unittest.main()
