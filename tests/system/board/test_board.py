#!/usr/bin/env python3
"""What counts facts of the board counts right: guest/tap.sh run here, by bash, and its lines read by board.py. No board is
started.

    test_board.py
"""
import contextlib
import io
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import board  # noqa: E402

PROJECT = HERE.parents[2]
GTEST = """#!/bin/sh
cat <<'END'
[ RUN      ] A.Good
[       OK ] A.Good (1 ms)
[ RUN      ] A.Bad
bad_test.cpp:7: Failure
[  FAILED  ] A.Bad (2 ms)
[ RUN      ] A.Left
left_test.cpp:9: Skipped
no camera here

[  SKIPPED ] A.Left (0 ms)
[  FAILED  ] 1 test, listed below:
[  FAILED  ] A.Bad
END
exit %d
"""


def facts_of(script, code=None, gtest=""):
    """[(name, kind)] of a case that is this script; the code with which it ends, or said to have ended."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        path = folder / "cases/group/some.sh"
        path.parent.mkdir(parents=True)
        path.write_text(script)
        tap = (HERE / "guest/tap.sh").read_text().replace("/run/results", name)
        (folder / "tap.sh").write_text(tap)
        if gtest:
            (folder / "some_test").write_text(gtest)
            (folder / "some_test").chmod(0o755)
        done = subprocess.run(["bash", "-c", f"source ./tap.sh\n{script}"], cwd=folder, capture_output=True, text=True)
        case = board.Case(path)
        for line in done.stdout.splitlines():
            case.hear(line)
        case.finish(done.returncode if code is None else code)
        junit = folder / "junit.xml"
        board.write_junit([case], junit)
        report = [PROJECT / "tests/lint/report_tests.py", junit, PROJECT / "tests/expected_skips.txt"]
        counted = subprocess.run(report, capture_output=True, text=True, check=False)
        return [fact[:2] for fact in case.facts], counted, case


class Facts(unittest.TestCase):
    def test_that_hold_pass(self):
        facts, counted, _ = facts_of("fact yes true; fact 'also yes' test 1 = 1; finish")
        self.assertEqual(facts, [("yes", "ok"), ("also yes", "ok")])
        self.assertEqual(counted.returncode, 0)
        self.assertIn("2 in all, 2 passed, 0 failed", counted.stdout)

    def test_that_do_not_hold_fail_with_what_was_said(self):
        facts, counted, case = facts_of("fact no sh -c 'echo reason; exit 3'; finish")
        self.assertEqual(facts, [("no", "not ok")])
        self.assertIn("reason", case.facts[0][2])
        self.assertEqual(counted.returncode, 1)

    def test_none_at_all_is_a_failure(self):
        facts, counted, _ = facts_of("finish")
        self.assertEqual(facts, [])
        self.assertEqual(counted.returncode, 1)
        self.assertIn("no test ran", counted.stdout)

    def test_a_case_that_does_not_reach_its_end_fails(self):
        for script in ("fact yes true; exit 0", "fact yes true; finish; exit 1"):
            facts, counted, _ = facts_of(script)
            self.assertEqual([kind for _, kind in facts], ["ok", "not ok"], script)
            self.assertEqual(counted.returncode, 1)

    def test_lost_on_the_way_are_missed(self):
        facts, _, _ = facts_of("facts=1; fact yes true; finish")
        self.assertEqual([kind for _, kind in facts], ["ok", "not ok"])

    def test_a_case_that_hangs_is_named_with_its_limit(self):
        facts, _, _ = facts_of("# limit: 7\nfact yes true", board.HUNG)
        self.assertEqual(facts[-1], ("is done within 7 s", "not ok"))

    def test_of_a_gtest_are_its_tests(self):
        facts, counted, case = facts_of("gtest some_test; finish", gtest=GTEST % 1)
        self.assertEqual(facts, [("A.Good", "ok"), ("A.Bad", "not ok"), ("A.Left", "skip")])
        self.assertIn("bad_test.cpp:7: Failure", case.facts[1][2])
        self.assertIn("no camera here", counted.stdout)

    def test_a_gtest_that_dies_fails(self):
        facts, _, _ = facts_of("gtest some_test; finish", gtest="#!/bin/sh\nkill -SEGV $$\n")
        self.assertEqual(facts, [("some_test ends with code 139", "not ok")])

    def test_eventually_waits_for_what_comes(self):
        facts, _, _ = facts_of("(sleep 0.3; touch here) & fact comes eventually test -e here; finish")
        self.assertEqual(facts, [("comes", "ok")])


class Cases(unittest.TestCase):
    def test_are_found_by_group_and_by_name(self):
        every = [case.name for case in board.cases_of([])]
        self.assertIn("capture/cameras", every)
        self.assertEqual([case.name for case in board.cases_of(["capture/cameras"])], ["capture/cameras"])
        self.assertTrue(set(case.name for case in board.cases_of(["gpio"])) < set(every))
        with self.assertRaises(board.UsageError):
            board.cases_of(["nothing"])

    def test_say_what_they_want_and_how_long_they_may_take(self):
        case = board.cases_of(["daemon/live"])[0]
        self.assertIn("bin/stereotrackd", case.wants)
        self.assertEqual(case.limit, 240)


class SideBySide(unittest.TestCase):
    def setUp(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            self.addCleanup(signal.signal, number, signal.getsignal(number))

    def test_cases_run_at_once_and_each_is_told_in_one_piece(self):
        cases = board.cases_of(["capture", "gpio"])[:2]
        both = threading.Barrier(2, timeout=20)

        def run_one(case):
            for number in range(3):
                both.wait()
                case.hear(f"ok {number + 1} - {case.name} {number}")
            case.hear("1..3")
            case.finish(0)

        with contextlib.redirect_stdout(io.StringIO()) as out:
            board.run_side_by_side(cases, 2, run_one)
        text = out.getvalue()
        for case in cases:
            self.assertEqual([fact[1] for fact in case.facts], ["ok"] * 3)
            self.assertIn(f"{case.name}\n  ok 1 - {case.name} 0\n  ok 2 - {case.name} 1\n  ok 3 - {case.name} 2\n", text)

    def test_what_one_raises_is_raised(self):
        def run_one(case):
            raise board.BoardError(case.name)

        with self.assertRaises(board.BoardError):
            board.run_side_by_side(board.cases_of(["capture"])[:1], 2, run_one)


unittest.main()
