#!/usr/bin/env python3
"""Counts what ctest ran (its --output-junit file) and names every skipped test with its reason.

    report_tests.py JUNIT.xml expected_skips.txt [--data FOLDER]

Nothing may pass because it was skipped. Exit 1 if
  * no test ran at all,
  * a test was skipped for want of test data although the data is there,
  * CI=true or STEREOTRACK_STRICT_SKIPS=1, and a test was skipped that expected_skips.txt does not name,
  * a test is disabled.
"""
import argparse
import os
import pathlib
import re
import sys
import xml.etree.ElementTree as xml

DATA = "shared/data"  # stands in the reason of every test that wants the recordings


def read_expected(path):
    """[(name pattern, text of the reason)]; the third column is for people and must be there."""
    rules = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        columns = [c.strip() for c in line.split(" | ")]
        if len(columns) != 3 or not all(columns):
            sys.exit(f"{path}:{number}: want NAME | text of the skip | why that is no loss")
        rules.append((re.compile(columns[0]), columns[1]))
    return rules


def reason_of(case):
    """The line that GTEST_SKIP() or a script printed."""
    text = "".join(case.findtext("system-out") or "")
    lines = [line.strip() for line in text.splitlines()]
    for at, line in enumerate(lines):
        if re.search(r": Skipped$", line):
            rest = [l for l in lines[at + 1 :] if l and not l.startswith("[")]
            return rest[0] if rest else "no reason given"
        if line.lower().startswith("skipped:"):
            return line[8:].strip()
    return "no reason given"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("junit", type=pathlib.Path)
    parser.add_argument("expected", type=pathlib.Path)
    default = pathlib.Path(__file__).resolve().parents[2].parent / DATA
    parser.add_argument("--data", type=pathlib.Path, default=default)
    args = parser.parse_args()

    strict = os.environ.get("CI") == "true" or os.environ.get("STEREOTRACK_STRICT_SKIPS") == "1"
    expected = read_expected(args.expected)
    if not args.junit.exists():
        sys.exit(f"{args.junit}: ctest wrote no report")
    cases = xml.parse(args.junit).getroot().findall("testcase")
    passed = failed = 0
    skipped, errors = [], []
    for case in cases:
        name, status = case.get("name"), case.get("status")
        if status == "disabled" or "DISABLED_" in name:
            errors.append(f"{name} is disabled: repair or remove it")
        elif status == "fail" or case.find("failure") is not None:
            failed += 1
        elif case.find("skipped") is not None or status != "run":
            skipped.append((name, reason_of(case)))
        else:
            passed += 1
    print(f"tests: {len(cases)} in all, {passed} passed, {failed} failed, {len(skipped)} skipped")
    for name, reason in skipped:
        print(f"  skipped {name}: {reason}")
        if DATA in reason and args.data.is_dir():
            errors.append(f"{name} is skipped for want of data, but {args.data} is there")
        elif strict and not any(p.fullmatch(name) and text in reason for p, text in expected):
            errors.append(f"{name} is skipped, and {args.expected.name} does not name it")
    if any(DATA in reason for _, reason in skipped) and not args.data.is_dir():
        print(f"the recordings of {args.data} are missing: what depends on them was NOT tested")
    if passed + failed == 0:
        errors.append("no test ran")
    for error in errors:
        print(f"error: {error}")
    sys.exit(1 if errors or failed else 0)


if __name__ == "__main__":
    main()
