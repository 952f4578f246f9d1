#!/usr/bin/env python3
"""The pipeline gives the same bits on 64-bit ARM as on this machine: tracks, masks, labels, rejections and telemetry of
each preset on synthetic:eleven, frame by frame, and the pixels of its pairs.

    same_on_aarch64.py NATIVE_PROGRAM EMULATED_PROGRAM [FRAMES [SCALAR_FRAMES]]

Both are stereotrack_pure. NEON is compared on FRAMES frames, the plain code on ARM on SCALAR_FRAMES. The emulator draws
but a few pairs, which takes it longest; the pipelines of both sides read what this machine draws.
"""
import subprocess
import sys

EMULATOR = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]
DRAWN = ["1:2", "90:91", "300:300"]


def results(command, pairs, *options):
    with subprocess.Popen(pairs, stdout=subprocess.PIPE) as source:
        done = subprocess.run([*command, "results", *options], stdin=source.stdout, capture_output=True, text=True)
    if done.returncode != 0 or source.returncode != 0:
        sys.exit(f"{' '.join(command)} results {' '.join(options)}: exit {done.returncode}\n{done.stderr}")
    return done.stdout.splitlines()


def compare_results(native, emulated, frames, *options):
    pairs = [native, "pairs", f"1:{frames}"]
    here = results([native], pairs, *options)
    there = results([*EMULATOR, emulated], pairs, *options)
    what = " ".join([f"frames 1:{frames}", *options])
    confirmed = here[-1].split()[1:]
    if len(here) != int(frames) + 2 or min(map(int, confirmed)) == 0:
        sys.exit(f"{what}: a frame is missing or a preset confirmed no track, so that little is compared")
    columns = here[0].split()
    for mine, other in zip(here, there):
        for column, a, b in zip(columns, mine.split(), other.split()):
            if a != b:
                sys.exit(f"{what}: frame {mine.split()[0]}: {column} differs: {a} here, {b} on aarch64")
    if len(here) != len(there):
        sys.exit(f"{what}: {len(here)} lines here, {len(there)} on aarch64")
    print(f"{what}: the same on aarch64; confirmed targets of all frames together {' and '.join(confirmed)}")


def compare_pixels(native, emulated):
    here, there = (subprocess.run([*command, "pairs", *DRAWN], check=True, stdout=subprocess.PIPE).stdout
                   for command in ([native], [*EMULATOR, emulated]))
    if not here or here != there:
        at = next((i for i, (a, b) in enumerate(zip(here, there)) if a != b), min(len(here), len(there)))
        sys.exit(f"pairs {' '.join(DRAWN)}: {len(here)} and {len(there)} bytes that differ at {at}")
    print(f"pixels of pairs {' '.join(DRAWN)}: the same on aarch64")


def main():
    native, emulated = sys.argv[1:3]
    frames = sys.argv[3] if len(sys.argv) > 3 else "60"
    scalar_frames = sys.argv[4] if len(sys.argv) > 4 else "30"
    compare_pixels(native, emulated)
    compare_results(native, emulated, frames, "--lens")
    compare_results(native, emulated, scalar_frames, "--simd", "scalar")


if __name__ == "__main__":
    main()
