#!/usr/bin/env python3
"""Instructions of `stereotrack_pure work` on 64-bit ARM, counted by a plugin of qemu-aarch64, and what they mean for two
ARM cores.

    count_aarch64.py --native PROGRAM --emulated PROGRAM --sysroot FOLDER --plugin libqemu_count.so [--callgrind]
                     [--warm-up N] [--frames N] [--json FILE]

Counts are exact and the same twice. Pairs are drawn by the native program. --callgrind counts it, too, on AVX2 at best.

The times are estimates. The lower bound is what a core's units allow, were nothing ever waited for:
    cycles = max(instructions / width, SIMD instructions / SIMD units, loads and stores / units for them)
    A72: 3 instructions decoded a cycle, 2 SIMD units, 1 load and 1 store     Arm Cortex-A72 Software Optimization Guide
    A76: 4 instructions decoded a cycle, 2 SIMD units, 2 loads or stores      Arm Cortex-A76 Software Optimization Guide
The upper bound is twice that: latencies that the core's window does not hide, caches and memory. Of real code of this
kind little lies outside; only a board can tell.

Exit 1 where a program fails, never because of a count; what is over its limit is said.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

LIMITS = {"sad_dense": 30e6}
CORES = {"A72": {"ghz": 1.8, "width": 3, "simd": 2, "memory": 2}, "A76": {"ghz": 2.4, "width": 4, "simd": 2, "memory": 2}}


# The pair that the benchmark's matchers have, and the frame before the first that its pipelines have.
MATCHED, BEFORE = 150, 60


def run(command, native, args):
    """What `command work` prints, fed with pairs."""
    pairs = [native, "pairs", f"{MATCHED}:{MATCHED}", f"{BEFORE + 1}:{BEFORE + args.warm_up + args.frames}"]
    command = [*command, "work", "--warm-up", str(args.warm_up)]
    with subprocess.Popen(pairs, stdout=subprocess.PIPE) as source:
        done = subprocess.run(command, stdin=source.stdout, capture_output=True, text=True)
    if done.returncode != 0 or source.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit {done.returncode}\n{done.stderr[-1000:]}")
    return done.stdout


def names_of(out):
    """{number: name} of what the program printed."""
    return {int(number): name for number, name in (line.split() for line in out.splitlines()[1:])}


def count_emulated(args):
    """{name: (calls, instructions, simd, memory)}, of all calls together."""
    with tempfile.TemporaryDirectory() as folder:
        counts = pathlib.Path(folder) / "counts"
        out = run(["qemu-aarch64", "-L", args.sysroot, "-plugin", f"{args.plugin},out={counts}", args.emulated], args.native, args)
        names = names_of(out)
        rows = [list(map(int, line.split())) for line in counts.read_text().splitlines()]
    if sorted(row[0] for row in rows) != sorted(names):
        sys.exit("the plugin saw other marks than the program made")
    return out.splitlines()[0].split()[1], {names[row[0]]: tuple(row[1:]) for row in rows}


def count_callgrind(args):
    """{name: instructions}, of all calls together."""
    with tempfile.TemporaryDirectory() as folder:
        out = run(["valgrind", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={folder}/out",
                   args.native], args.native, args)
        sums = {}
        for file in pathlib.Path(folder).iterdir():
            text = file.read_text()
            name = re.search(r"^desc: Trigger: Client Request: (.*)$", text, re.M)
            total = re.search(r"^totals: (\d+)", text, re.M)
            if name and total:
                sums[name.group(1)] = sums.get(name.group(1), 0) + int(total.group(1))
    return out.splitlines()[0].split()[1], sums


def milliseconds(core, all_, simd, memory):
    cycles = max(all_ / core["width"], simd / core["simd"], memory / core["memory"])
    return cycles / core["ghz"] / 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--native", required=True, help="stereotrack_pure, built for this machine")
    parser.add_argument("--emulated", required=True, help="stereotrack_pure, built for 64-bit ARM")
    parser.add_argument("--sysroot", required=True, help="the C library and all others of the emulated program")
    parser.add_argument("--plugin", required=True)
    parser.add_argument("--callgrind", action="store_true")
    parser.add_argument("--warm-up", type=int, default=32)
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--json", type=pathlib.Path)
    args = parser.parse_args()

    simd, counted = count_emulated(args)
    if simd != "neon":
        sys.exit(f"the program runs {simd} code, not NEON")
    native_simd, native = count_callgrind(args) if args.callgrind else (None, {})

    entries = {}
    for name, (calls, *sums) in counted.items():
        for whole in {name, name.split("/")[0]}:
            entry = entries.setdefault(whole, {"calls": calls, "sums": [0, 0, 0], "native": 0})
            entry["sums"] = [a + b for a, b in zip(entry["sums"], sums)]
            entry["native"] += native.get(name, 0)
    result = {}
    for name, entry in entries.items():
        per_call = [value / entry["calls"] for value in entry["sums"]]
        row = {"instructions": per_call[0], "simd": per_call[1], "memory": per_call[2]}
        if native:
            row["native"] = entry["native"] / entry["calls"]
        for core, numbers in CORES.items():
            least = milliseconds(numbers, *per_call)
            row[core] = [least, 2 * least]
        result[name] = row

    head = f"{'millions of instructions a call':32}{'neon':>9}{'of them SIMD':>14}{'memory':>8}"
    if native:
        head += f"{native_simd:>9}"
    print(head + "".join(f"{core + ' ' + str(n['ghz']) + ' GHz, ms':>20}" for core, n in CORES.items()))
    for name in sorted(result, key=lambda n: (n.split("/")[0] not in ("sad_dense", "census_dense"), n.split("/")[0],
                                              "/" in n, list(result).index(n))):
        row = result[name]
        line = f"{name:32}{row['instructions'] / 1e6:9.2f}{row['simd'] / 1e6:14.2f}{row['memory'] / 1e6:8.2f}"
        if native:
            line += f"{row['native'] / 1e6:9.2f}"
        print(line + "".join(f"{row[core][0]:12.2f} to {row[core][1]:5.2f}" for core in CORES))
    print(f"SIMD: instructions of the vector and floating point units; memory: loads and stores. Pipelines: mean of "
          f"{args.frames} frames of synthetic:eleven, 640x480, after {args.warm_up}.\nTimes are estimates, between what "
          f"a core's units allow and twice that: see --help.")
    if args.json:
        args.json.write_text(json.dumps({"simd": simd, "native_simd": native_simd, "cores": CORES, "warm_up": args.warm_up,
                                         "frames": args.frames, "work": result}, indent=1) + "\n")
    for name, limit in LIMITS.items():
        count = result[name]["instructions"]
        print(f"{name}: {count / 1e6:.2f} million instructions, at most {limit / 1e6:.0f} wanted: "
              f"{'reached' if count <= limit else 'missed'}")


if __name__ == "__main__":
    main()
