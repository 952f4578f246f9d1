#!/usr/bin/env python3
"""Test programs for another CPU, in an emulator of one process.

    emulated.py run --results FOLDER PROGRAM EMULATOR [ARGUMENT...]    all tests of a program, less what is left out
    emulated.py report --results FOLDER [--part]                       counts what all programs ran, and what none did

Left out is what left_out.txt names, beside this file, and nothing else: a test that skips itself fails the report where
../expected_skips.txt does not name it, and so does a line of left_out.txt that leaves out nothing.
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as xml

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "lint"))
from report_tests import DATA, read_expected  # noqa: E402


def read_left_out(path):
    """[(pattern, why)] of tests, {what else: why}."""
    tests, programs = [], {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        columns = [column.strip() for column in line.split(" | ")]
        if len(columns) != 2 or not all(columns):
            sys.exit(f"{path.name}:{number}: want NAME | why")
        if columns[0].startswith(("program ", "room ")):
            programs[columns[0]] = columns[1]
        else:
            tests.append((columns[0], columns[1]))
    return tests, programs


def tests_of(command):
    """All tests of a program of GoogleTest."""
    out = subprocess.run([*command, "--gtest_list_tests"], check=True, capture_output=True, text=True).stdout
    names, suite = [], None
    for line in out.splitlines():
        name = line.split("  #")[0].rstrip()
        if not line.startswith(" "):
            suite = name if name.endswith(".") else None
        elif suite:
            names.append(suite + name.strip())
    return names


def run(args):
    emulator = [shutil.which(args.emulator[0]) or args.emulator[0], *args.emulator[1:]]
    # What a test starts is of the other CPU, too: ../support/run_program.hpp.
    os.environ["STEREOTRACK_EMULATOR"] = "\n".join(emulator)
    command = [*emulator, args.program]
    names = tests_of(command)
    if not names:
        sys.exit(f"{args.program} has no tests")
    rules, _ = read_left_out(args.left_out)
    left_out = {}
    for name in names:
        for pattern, _ in rules:
            if re.fullmatch(pattern, name):
                left_out[name] = pattern
                break
    args.results.mkdir(parents=True, exist_ok=True)
    stem = pathlib.Path(args.program).name
    report = args.results / f"{stem}.xml"
    report.unlink(missing_ok=True)
    (args.results / f"{stem}.json").write_text(json.dumps(left_out))
    if len(left_out) == len(names):
        sys.exit(f"all tests of {stem} are left out: name the program in {args.left_out.name}")
    filters = "*" + ("-" + ":".join(left_out) if left_out else "")
    done = subprocess.run([*command, f"--gtest_filter={filters}", f"--gtest_output=xml:{report}", "--gtest_brief=1"])
    if done.returncode == 0 and len(list(xml.parse(report).getroot().iter("testcase"))) != len(names) - len(left_out):
        sys.exit(f"{stem} did not run what it was told to")
    return 1 if done.returncode else 0


def report(args):
    rules, programs = read_left_out(args.left_out)
    expected = read_expected(HERE.parent / "expected_skips.txt")
    strict = os.environ.get("CI") == "true" or os.environ.get("STEREOTRACK_STRICT_SKIPS") == "1"
    have_data = (HERE.parents[2] / DATA).is_dir()
    passed, failed, skipped, errors = 0, [], [], []
    slow = []
    left = {pattern: 0 for pattern, _ in rules}
    for listed in sorted(args.results.glob("*.json")):
        for pattern in json.loads(listed.read_text()).values():
            left[pattern] = left.get(pattern, 0) + 1
        if not listed.with_suffix(".xml").exists():
            errors.append(f"{listed.stem} did not reach its end")
            continue
        for case in xml.parse(listed.with_suffix(".xml")).getroot().iter("testcase"):
            name = f"{case.get('classname')}.{case.get('name')}"
            slow.append((float(case.get("time")), name))
            if case.find("failure") is not None:
                failed.append(name)
            elif case.find("skipped") is not None:
                skipped.append((name, case.find("skipped").get("message").splitlines()[-1]))
            else:
                passed += 1
    print(f"emulated: {passed} tests passed, {len(failed)} failed, {len(skipped)} skipped, {sum(left.values())} left "
          f"out, and {len(programs)} programs and rooms")
    for name in failed:
        print(f"  failed {name}")
    for name, reason in skipped:
        print(f"  skipped {name}: {reason}")
        if DATA in reason and have_data:
            errors.append(f"{name} is skipped for want of data, which is there")
        elif strict and not any(p.fullmatch(name) and text in reason for p, text in expected):
            errors.append(f"{name} is skipped, and expected_skips.txt does not name it")
    for pattern, why in rules:
        print(f"  left out {left[pattern]}: {pattern}: {why}")
        if left[pattern] == 0 and not args.part:
            errors.append(f"{args.left_out.name}: {pattern} leaves out nothing")
    for name, why in programs.items():
        print(f"  left out {name}: {why}")
    for seconds, name in sorted(slow, reverse=True)[: args.slowest]:
        print(f"  {seconds:6.1f} s {name}")
    if passed == 0:
        errors.append("no test ran")
    for error in errors:
        print(f"error: {error}")
    return 1 if errors or failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True)
    one = verbs.add_parser("run")
    one.add_argument("program")
    one.add_argument("emulator", nargs=argparse.REMAINDER)
    all_ = verbs.add_parser("report")
    all_.add_argument("--part", action="store_true", help="not all programs were to run")
    all_.add_argument("--slowest", type=int, default=5, metavar="N")
    for verb in (one, all_):
        verb.add_argument("--results", type=pathlib.Path, required=True)
        verb.add_argument("--left-out", type=pathlib.Path, default=HERE / "left_out.txt")
    args = parser.parse_args()
    return {"run": run, "report": report}[args.verb](args)


if __name__ == "__main__":
    sys.exit(main())
