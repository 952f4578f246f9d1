#!/usr/bin/env python3
"""The rules of docs/CONTRIBUTING.md that a compiler and clang-tidy do not know. One line a finding:
FILE:LINE: [rule] what is wrong. Exit 1 if there is any. The rules themselves are tested by test_rules.py.
"""
import argparse
import pathlib
import re
import sys

ROOMS = ("pipeline", "drivers", "config", "firmware-app", "tests")
NOT_OURS = {".git", "build", "out", ".cache", "__pycache__"}
CODE = {".hpp", ".cpp", ".h", ".c", ".in"}
BINARY = {".png", ".jpg", ".jpeg", ".mp4", ".avi", ".gif", ".bin"}

# Arrows: firmware-app -> config, drivers -> pipeline -> pipeline/core.
MAY_INCLUDE = {
    "firmware-app": {"firmware-app", "config", "drivers", "pipeline"},
    "config": {"config", "pipeline"},
    "drivers": {"drivers", "pipeline"},
    "pipeline": {"pipeline"},
}
# The pipeline is pure: what it may include besides itself, and nothing else. Headers with files, streams, threads,
# clocks of the system, locks, formatted text or hash containers (their order differs between libraries) are missing.
PURE = {
    "algorithm", "array", "bit", "chrono", "cmath", "compare", "concepts", "cstddef", "cstdint", "cstdlib", "cstring",
    "iterator", "limits", "memory", "new", "numbers", "numeric", "optional", "ratio", "span", "string_view", "tuple",
    "type_traits", "utility", "variant", "tl/expected.hpp",
}
PURE_FOLDERS = ("Eigen/", "hwy/")
# What hands over between threads is made of it; the stages have one thread.
CORE_ONLY = {"atomic"}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
NOLINT = re.compile(r"NOLINT(NEXTLINE|BEGIN|END)?")
NOLINT_GOOD = re.compile(r"NOLINT(?:NEXTLINE|BEGIN)?\([\w.,\- ]+\): \S.{5,}|NOLINTEND\([\w.,\- ]+\)")
TODO = re.compile(r"\b(TODO|FIXME|XXX)\b")
TODO_GOOD = re.compile(r"\bTODO\([^)]{5,}\): \S")
MACHINE_PATH = re.compile(r"(?<![\w.$}])(/work/|/root/|/home/[a-z]|/Users/|/builds/|[A-Z]:\\\\?Users)")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


def ours(root):
    for path in sorted(root.rglob("*")):
        parts = path.relative_to(root).parts
        if not NOT_OURS.intersection(parts) and path.is_file() and path.suffix not in BINARY:
            yield path


def without_comments(text):
    """Comments and strings blanked, lines kept."""
    blank = lambda m: re.sub(r"[^\n]", " ", m.group(0))
    return re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', blank, text, flags=re.S)


def text_rules(name, lines, text):
    if text and not text.endswith("\n"):
        yield len(lines), "whitespace", "the last line has no end"
    for number, line in enumerate(lines, 1):
        if "\t" in line:
            yield number, "whitespace", "a tab: want spaces"
        if line != line.rstrip():
            yield number, "whitespace", "space at the end of the line"
        if name.parts[:2] == ("tests", "lint"):
            continue  # the rules and their known-bad examples
        if NOLINT.search(line) and not NOLINT_GOOD.search(line) and name.name != "CONTRIBUTING.md":
            yield number, "nolint", "want NOLINT(check): reason"
        if TODO.search(line) and not TODO_GOOD.search(line) and name.name != "CONTRIBUTING.md":
            yield number, "todo", "want TODO(reason why it stays): what"
        if MACHINE_PATH.search(line):
            yield number, "machine-path", "a path of one machine: build it from STEREOTRACK_SOURCE_DIR or an argument"


def include_rules(name, lines):
    room = name.parts[0]
    for number, line in enumerate(lines, 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        target = match.group(2)
        top = target.split("/")[0]
        if ".." in target.split("/"):
            yield number, "arrow", f"{target}: includes start at the project's root"
        elif top in ROOMS and "/" in target:
            if room in MAY_INCLUDE and top not in MAY_INCLUDE[room]:
                yield number, "arrow", f"{room} must not know {top} ({target})"
            elif name.parts[:2] == ("pipeline", "core") and not target.startswith("pipeline/core/"):
                yield number, "arrow", f"pipeline/core knows nothing but itself ({target})"
        elif room == "pipeline" and target in CORE_ONLY and name.parts[:2] == ("pipeline", "core"):
            continue
        elif room == "pipeline" and target not in PURE and not target.startswith(PURE_FOLDERS):
            yield number, "pure", f"{target} is not on the pipeline's list of headers (tests/lint/check_rules.py)"


def code_rules(name, text):
    code = without_comments(text)
    if name.parts[0] == "pipeline" or name.stem.endswith("_rt"):
        for number, line in enumerate(code.splitlines(), 1):
            if re.search(r"(\.|->)\s*value\s*\(\s*\)", line):
                yield number, "value", "value() throws, and here nothing may: has_value(), then *"
    if name.parts[0] == "pipeline":
        for number, line in enumerate(code.splitlines(), 1):
            if re.search(r"\bvirtual\b", line):
                yield number, "virtual", "no virtual inside the pipeline"
    if name.parts[0] == "pipeline" and name.suffix == ".hpp":
        for match in re.finditer(r"\bstatic Result<(\w+)>\s+create\([^;{]*\bArena&", code):
            if not re.search(rf"\bstatic_assert\(RealTimeStage<{match.group(1)}\b", code):
                yield code.count("\n", 0, match.start()) + 1, "stage", \
                    f"want static_assert(RealTimeStage<{match.group(1)}, &...>) (pipeline/core/stage.hpp)"
    # What Highway compiles once for each instruction set has a guard of its own.
    if name.suffix == ".hpp" and "#pragma once" not in text and "defined(HWY_TARGET_TOGGLE)" not in text:
        yield 1, "guard", "a header without #pragma once"


def find_circle(edges):
    """A list of nodes A, B, ..., A or None."""
    done, path = set(), []

    def visit(node):
        if node in path:
            return path[path.index(node):] + [node]
        if node in done:
            return None
        path.append(node)
        for other in sorted(edges.get(node, ())):
            circle = visit(other)
            if circle:
                return circle
        path.pop()
        done.add(node)
        return None

    for node in sorted(edges):
        circle = visit(node)
        if circle:
            return circle
    return None


def circles(files):
    """No room of the pipeline, of config or of drivers includes in a circle (pipeline/x -> pipeline/y -> pipeline/x)."""
    edges = {}
    for name, lines in files:
        if name.parts[0] not in MAY_INCLUDE or len(name.parts) < 3:
            continue
        for line in lines:
            match = INCLUDE.match(line)
            target = match.group(2).split("/") if match else []
            if len(target) >= 3 and target[0] in MAY_INCLUDE and tuple(target[:2]) != name.parts[:2]:
                edges.setdefault("/".join(name.parts[:2]), set()).add("/".join(target[:2]))
    circle = find_circle(edges)
    if circle:
        yield pathlib.Path(circle[0]), 1, "circle", " -> ".join(circle)


def unregistered_tests(root, names):
    """A test that no CMakeLists.txt names never runs and never fails."""
    lists = {n.parent: (root / n).read_text() for n in names if n.name == "CMakeLists.txt" and n.parts[0] == "tests"}
    for name in names:
        if name.parts[0] != "tests" or not re.fullmatch(r"test_\w+\.(cpp|py|sh)|\w+_test\.(cpp|py|sh)", name.name):
            continue
        if not any(name.name in text for folder, text in lists.items() if name.is_relative_to(folder)):
            yield name, 1, "unregistered-test", "no CMakeLists.txt names this test"


def broken_links(root, name, lines):
    for number, line in enumerate(lines, 1):
        for target in LINK.findall(line):
            if "://" not in target and not target.startswith("mailto:") and not (root / name.parent / target).exists():
                yield number, "link", f"{target} does not exist"


def findings(root):
    files = []
    for path in ours(root):
        name = path.relative_to(root)
        try:
            text = path.read_bytes().decode("utf-8")
        except UnicodeDecodeError:
            yield name, 1, "encoding", "not UTF-8"
            continue
        lines = text.split("\n")
        files.append((name, lines))
        found = [] if name.name == "LICENSE" else list(text_rules(name, lines, text))
        if name.suffix in CODE:
            found += list(include_rules(name, lines)) + list(code_rules(name, text))
        if name.suffix == ".md":
            found += list(broken_links(root, name, lines))
        for number, rule, what in found:
            yield name, number, rule, what
    yield from circles([f for f in files if f[0].suffix in CODE])
    yield from unregistered_tests(root, [name for name, _ in files])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2])
    root = parser.parse_args().root.resolve()
    count = 0
    for name, number, rule, what in findings(root):
        print(f"{name}:{number}: [{rule}] {what}")
        count += 1
    print(f"rules: {sum(1 for _ in ours(root))} files, {count} findings")
    sys.exit(1 if count else 0)


if __name__ == "__main__":
    main()
