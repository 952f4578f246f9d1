#!/usr/bin/env python3
"""Documents that are wrong are worse than none: runs the README's commands, and looks up every option, key and verb.

    test_readme.py PROJECT BIN      BIN: folder that holds the built programs
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

PROJECT, BIN = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
BLOCK = re.compile(r"<!-- tested -->\n```sh\n(.*?)```", re.S)
README = (PROJECT / "README.md").read_text()
PAGES = [PROJECT / "README.md", *sorted((PROJECT / "docs").glob("*.md"))]


def run(command, **options):
    env = {**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"}
    return subprocess.run(command, env=env, capture_output=True, text=True, check=False, **options)


def commands(page):
    """Each call of stereotrack in code: blocks, indented lines, `words`; as (subcommand, text)."""
    text = page.read_text().replace("\\\n", " ")
    code = "\n".join(re.findall(r"^```\w*\n(.*?)^```", text, re.M | re.S) + re.findall(r"^    (\S.*)$", text, re.M))
    calls = re.findall(r"^(stereotrack [a-z].*)$", code, re.M) + re.findall(r"`(stereotrack [a-z][^`\n]*)`", text)
    for call in calls:
        yield call.split()[1], re.split(r" [#|] ", call)[0]


class Readme(unittest.TestCase):
    def test_commands_run(self):
        blocks = BLOCK.findall(README)
        self.assertGreaterEqual(len(blocks), 3)
        with tempfile.TemporaryDirectory() as folder:
            for block in blocks:
                with self.subTest(block=block):
                    done = run(["bash", "-euo", "pipefail", "-c", block], cwd=folder, timeout=240)
                    self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            rows = pathlib.Path(folder, "out/tracks.csv").read_text().splitlines()
            self.assertGreater(len(rows), 0, "the README's first run tracks nothing")
            columns = re.findall(r"^\| (`[^|]+`) \|", README.split("## Reading the output")[1], re.M)
            self.assertEqual(len(" ".join(columns).split()), len(rows[0].split(",")))

    def test_dev_verbs_exist(self):
        told = run([str(PROJECT / "dev"), "help"]).stdout
        for page in PAGES:
            for verb in re.findall(r"\./dev ([a-z][a-z-]*)", page.read_text()):
                with self.subTest(page=page.name, verb=verb):
                    self.assertRegex(told, rf"(?m)^  {verb}\b")


class Pages(unittest.TestCase):
    def test_options_exist(self):
        helps = {}
        known = re.findall(r"^  (\w+) ", run(["stereotrack", "--help"]).stdout.split("Subcommands:")[1], re.M)
        for page in PAGES:
            for sub, text in commands(page):
                self.assertIn(sub, known, f"{page.name}: {text}: no such subcommand")
                if sub not in helps:
                    helps[sub] = run(["stereotrack", sub, "--help"]).stdout
                for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", text):
                    with self.subTest(page=page.name, command=text):
                        self.assertIn(option, helps[sub])

    def test_options_of_the_daemon_exist(self):
        told = run(["stereotrackd", "--help"]).stdout
        for page in PAGES:
            for call in re.findall(r"^(?:    )?(stereotrackd [^#|\n]*)", page.read_text(), re.M):
                for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", call):
                    with self.subTest(page=page.name, command=call):
                        self.assertIn(option, told)

    def test_keys_exist(self):
        sample, section, keys = (PROJECT / "config/stereotrack.sample.toml").read_text(), "", {"preset"}
        for line in sample.splitlines():
            if match := re.match(r"\[([\w.]+)\]", line):
                section = match.group(1) + "."
            elif match := re.match(r"(\w+) =", line):
                keys.add(section + match.group(1))
        sections = {k.split(".")[0] for k in keys}
        for page in PAGES:
            text = page.read_text()
            for key in re.findall(r"--set ([\w.]+)=", text) + re.findall(r"`([a-z_]+(?:\.[a-z_0-9]+)+)`", text):
                if key.split(".")[0] in sections and not key.endswith((".csv", ".json", ".toml", ".yml", ".bin")):
                    with self.subTest(page=page.name, key=key):
                        self.assertIn(key, keys)

    def test_keys_of_the_doctor_exist(self):
        page = (PROJECT / "docs/DOCTOR.md").read_text()
        told = json.loads(run(["stereotrack", "doctor", "--no-measure", "--json"]).stdout)
        keys = re.findall(r"`([a-z_]+(?:\.[a-z_]+)*)`", "\n".join(re.findall(r"^\| (`[^|]*`) \|", page, re.M)))
        self.assertGreater(len(keys), 15)
        for path in keys:
            value = told
            for key in path.split("."):
                value = value[0] if isinstance(value, list) and value else value
                if not value and key not in (value or {}):
                    break  # nothing of the kind here, or not measured
                with self.subTest(key=path):
                    self.assertIn(key, value)
                value = value[key]


class Board(unittest.TestCase):
    """docs/BOARD.md, which tests/system/board/cases/rig/manual.sh follows on the board."""
    PAGE = (PROJECT / "docs/BOARD.md").read_text()
    CASE = (PROJECT / "tests/system/board/cases/rig/manual.sh").read_text()
    SECTIONS = {title: body for title, body in re.findall(r"^## (.*)\n((?:(?!## ).*\n)*)", PAGE, re.M)}

    @staticmethod
    def blocks(body):
        """Runs of indented lines."""
        return re.findall(r"(?m)(?:^    .*\n)+", body)

    def test_each_block_is_run_there_or_said_to_need_the_hardware(self):
        said = re.search(r"(\"[^.]*) \*\*need the hardware\*\*", self.PAGE)[1]
        self.assertGreater(len(self.SECTIONS), 4)
        for title, body in self.SECTIONS.items():
            run_there = set(re.findall(rf'(?:follow|block) "?{re.escape(title)}"? (\d+)', self.CASE))
            there = {str(number) for number in range(1, len(self.blocks(body)) + 1)}
            with self.subTest(section=title):
                self.assertEqual(run_there, set() if f'"{title}"' in said else there)

    def test_its_configuration_lacks_nothing_but_the_cameras(self):
        configuration = next(block for block in self.blocks(self.SECTIONS["Install"]) if "[source]" in block)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "rig.toml")
            for key, code in (("exposure_us", 1), ("exposure_uss", 2)):
                path.write_text(re.sub("(?m)^    ", "", configuration).replace("exposure_us", key))
                done = run(["stereotrackd", "--config", str(path), "--check-config"])
                self.assertEqual(done.returncode, code, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
