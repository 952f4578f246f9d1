#!/usr/bin/env python3
"""Runs clang-tidy over our sources of a compile_commands.json.

What passed once is remembered by the hash of all that clang-tidy sees (preprocessed text with comments, the
configuration, the program's version), so a second run costs seconds. Findings are never remembered.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import time

ROOMS = ("pipeline", "drivers", "config", "firmware-app", "tests")
GCC_ONLY = {"-fno-ipa-ra", "-Winvalid-pch"}  # clang-tidy takes what it does not know for an error


def our_entries(build, root):
    """One compile command for each of our source files; generated code lies outside of ROOT or under build/."""
    seen = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        file = pathlib.Path(entry["directory"], entry["file"]).resolve()
        if not file.is_relative_to(root) or file.suffix != ".cpp":
            continue
        name = file.relative_to(root)
        if name.parts[0] in ROOMS:
            seen.setdefault(name.as_posix(), (file, entry))
    return seen


def without_launcher(command):
    words = shlex.split(command)
    while words and os.path.basename(words[0]) in ("ccache", "sccache"):
        words.pop(0)
    return words


def for_clang(words):
    """WORDS of a command without what only GCC knows: a source is read with the headers that it names itself."""
    kept = []
    for word in words:
        if kept and kept[-1] == "-include" and word.endswith("cmake_pch.hxx"):
            kept.pop()
        elif word not in GCC_ONLY:
            kept.append(word)
    return kept


def write_for_clang(build, folder):
    """The build's compile commands without what only GCC knows, in FOLDER, for clang-tidy -p."""
    entries = json.loads((build / "compile_commands.json").read_text())
    for entry in entries:
        entry["command"] = shlex.join(for_clang(shlex.split(entry["command"])))
    (folder / "compile_commands.json").write_text(json.dumps(entries))


def preprocessed(entry):
    words = for_clang(without_launcher(entry["command"]))
    if "-o" in words:
        at = words.index("-o")
        del words[at : at + 2]
    words = [w for w in words if w != "-c"] + ["-E", "-C"]
    done = subprocess.run(words, cwd=entry["directory"], capture_output=True, check=False)
    return done.stdout if done.returncode == 0 else None


def included(entry, root):
    """Our files that a source includes, itself too; None if it cannot be preprocessed."""
    text = preprocessed(entry)
    if text is None:
        return None
    names = set()
    for line in text.splitlines():
        if line.startswith(b'# ') and line.count(b'"') >= 2:
            path = pathlib.Path(os.fsdecode(line.split(b'"')[1]))
            if path.is_absolute() and path.is_relative_to(root):
                names.add(path.relative_to(root).as_posix())
    return names


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=pathlib.Path, required=True)
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only-touching", nargs="*", metavar="FILE", help="sources that are or include one of these")
    parser.add_argument("--cache", type=pathlib.Path)
    parser.add_argument("--fix", action="store_true", help="let clang-tidy repair what it can")
    args = parser.parse_args()

    tidy = shutil.which("clang-tidy")
    if tidy is None:
        sys.exit("clang-tidy is not installed: run ./dev lint, which installs it")
    root = args.root.resolve()
    cache = args.cache or args.build / "lint-cache"
    cache.mkdir(parents=True, exist_ok=True)
    salt = subprocess.run([tidy, "--version"], capture_output=True, check=True).stdout
    salt += (root / ".clang-tidy").read_bytes()

    write_for_clang(args.build, cache)
    entries = our_entries(args.build, root)
    if not entries:
        sys.exit(f"{args.build}: compile_commands.json names none of our sources")
    if args.only_touching is not None:
        changed = set(args.only_touching)
        entries = {n: e for n, e in entries.items() if (included(e[1], root) or {n}) & changed}

    def check(name):
        file, entry = entries[name]
        text = preprocessed(entry)
        mark = None
        if text is not None:
            words = " ".join(without_launcher(entry["command"])).encode()
            mark = cache / hashlib.sha256(salt + words + text).hexdigest()
            if mark.exists():
                return name, 0, "", True
        command = [tidy, "-p", str(cache), "--quiet", str(file)] + (["--fix"] if args.fix else [])
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0 and mark is not None:
            mark.touch()
        return name, done.returncode, done.stdout + done.stderr, False

    began = time.monotonic()
    bad, cached = [], 0
    jobs = 1 if args.fix else args.jobs
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for name, code, text, known in pool.map(check, sorted(entries)):
            cached += known
            if code != 0:
                bad.append(name)
                print(text, flush=True)
    print(f"clang-tidy: {len(entries)} sources, {cached} known from before, {len(bad)} with findings, "
          f"{time.monotonic() - began:.0f} s")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
