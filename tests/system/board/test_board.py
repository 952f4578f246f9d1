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
import unittest.mock

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


class Wanted(unittest.TestCase):
    def test_a_package_is_made_by_the_target_of_all(self):
        self.assertEqual(board.target_of("packages/stereotrack-tools"), "packages")
        self.assertEqual(board.target_of("tests/gpio_board_test"), "gpio_board_test")

    def test_a_package_is_the_one_deb_of_that_name(self):
        with tempfile.TemporaryDirectory() as name:
            build = pathlib.Path(name)
            (build / "packages").mkdir()
            self.assertEqual(board.wanted(build, "bin/stereotrackd"), build / "bin/stereotrackd")
            with self.assertRaisesRegex(board.UsageError, "there is: none"):
                board.wanted(build, "packages/stereotrack")
            (build / "packages/stereotrack-tools_1.0_arm64.deb").touch()
            (build / "packages/stereotrack_1.0_arm64.deb").touch()
            self.assertEqual(board.wanted(build, "packages/stereotrack").name, "stereotrack_1.0_arm64.deb")
            (build / "packages/stereotrack_1.1_arm64.deb").touch()
            with self.assertRaisesRegex(board.UsageError, "_1.0_arm64.deb, .*_1.1_arm64.deb"):
                board.wanted(build, "packages/stereotrack")


class PowerCut(unittest.TestCase):
    """board.run with emulators that say what they are told to here, and are killed where the real ones would be."""

    def boards(self, *says, cuts):
        begun, killed = [], []

        class Emulator:
            def __init__(self, _, options):
                self.said = says[len(begun)]
                self.heard = []
                begun.append((options, self.heard))

            def __enter__(self):
                return self

            def __exit__(self, *_):
                killed.append(len(begun))

            def say(self, text):
                self.heard.append(text)

            def lines(self, _):
                yield from self.said

        told = []
        with tempfile.TemporaryDirectory() as name, unittest.mock.patch.multiple(
                board, CACHE=pathlib.Path(name), Machine=Emulator, make_disks=lambda *_: None,
                make=lambda _: (pathlib.Path(name) / "disk.qcow2", "state")):
            (pathlib.Path(name) / "debian12").mkdir()
            subprocess.run(["qemu-img", "create", "-q", "-f", "qcow2", f"{name}/disk.qcow2", "1M"], check=True)
            result = board.run(board.Board("debian12", "steady"), {}, "start", 5, None, told.append, cuts)
        self.assertEqual(killed, list(range(1, len(begun) + 1)))
        return result, told, begun

    def test_boots_the_board_anew_with_its_disks_and_goes_on_counting(self):
        result, told, begun = self.boards(
            ["ok 1 - before", "board: cut the power after 1 facts and 7 s", "ok 2 - never heard"],
            ["board: ready", "ok 2 - after", "board: took 5", "board: end 0"], cuts=1)
        self.assertEqual(result, (0, 12))
        self.assertEqual(told, ["ok 1 - before", "ok 2 - after"])
        first, second = ([str(word) for word in options] for options, _ in begun)
        self.assertIn("-incoming", first)
        self.assertNotIn("-incoming", second)
        self.assertIn("board.cuts=1 board.facts=1", " ".join(second))
        disks = [[word for word in words if word.startswith("file=") and "control" not in word] for words in (first, second)]
        self.assertEqual(disks[0], disks[1])
        self.assertFalse([word for word in disks[0] if "snapshot=on" in word])
        for _, heard in begun:
            self.assertEqual([text.split()[0] for text in heard], ["start"])

    def test_that_no_head_tells_of_is_refused(self):
        with self.assertRaisesRegex(board.BoardError, "a power cut more than the 0"):
            self.boards(["board: cut the power after 0 facts and 0 s"], cuts=0)

    def test_facts_are_counted_on_by_the_case(self):
        done = subprocess.run(["bash", "-c", f"source {HERE}/guest/tap.sh; fact yes true; finish"], capture_output=True,
                              text=True, env={"PATH": "/usr/bin:/bin", "FACTS": "4"})
        self.assertEqual(done.stdout, "ok 5 - yes\n1..5\n")


class Cases(unittest.TestCase):
    def test_are_found_by_group_and_by_name(self):
        every = [case.name for case in board.cases_of([])]
        self.assertIn("capture/cameras", every)
        self.assertEqual([case.name for case in board.cases_of(["capture/cameras"])], ["capture/cameras"])
        self.assertTrue(set(case.name for case in board.cases_of(["gpio"])) < set(every))
        with self.assertRaises(board.UsageError):
            board.cases_of(["nothing"])

    def test_that_take_long_are_run_only_by_name(self):
        self.assertTrue(board.cases_of(["rig/hour"])[0].only_by_name)
        for names in ([], ["rig"]):
            self.assertNotIn("rig/hour", [case.name for case in board.cases_of(names)])

    def test_say_what_they_want_and_how_long_they_may_take(self):
        case = board.cases_of(["daemon/live"])[0]
        self.assertIn("bin/stereotrackd", case.wants)
        self.assertEqual(case.limit, 240)
        self.assertEqual(case.cuts, 0)
        self.assertEqual(board.cases_of(["rig/power_cut"])[0].cuts, 2)

    def test_run_on_the_boards_that_they_name_else_on_all(self):
        on_all = board.cases_of(["board/promised"])[0]
        self.assertEqual(on_all.boards, ["debian12", "debian13"])
        self.assertEqual(board.cases_of(["gpio/lines_2"])[0].boards, ["debian12"])
        self.assertNotIn("gpio/lines_2", [case.name for case in board.cases_of(["gpio"], "debian13")])
        with self.assertRaisesRegex(board.UsageError, "none of gpio/lines_2 runs on debian13"):
            board.cases_of(["gpio/lines_2"], "debian13")


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
