#!/usr/bin/env python3
"""What a package brings besides programs agrees with them: man pages, completions, the configuration, the changelog.

    test_files.py PROJECT BUILD
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

PROJECT, BUILD = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
DEBIAN = PROJECT / "toolchains/debian"
PAGES = {"stereotrackd": PROJECT / "docs/man/stereotrackd.8", "stereotrack": PROJECT / "docs/man/stereotrack.1"}


def run(*command, **options):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, **options)


def options_of(help_text):
    return set(re.findall(r"^  (?:-\w,)?(--[a-z][a-z-]*)", help_text, re.M))


def helps():
    """(program, subcommand or "", its options)."""
    yield "stereotrackd", "", options_of(run(BUILD / "bin/stereotrackd", "--help").stdout)
    told = run(BUILD / "bin/stereotrack", "--help").stdout
    yield "stereotrack", "", options_of(told)
    for sub in re.findall(r"^  (\w+) ", told.split("Subcommands:")[1], re.M):
        yield "stereotrack", sub, options_of(run(BUILD / "bin/stereotrack", sub, "--help").stdout)


class Manual(unittest.TestCase):
    def test_each_option_stands_in_it(self):
        for program, sub, options in helps():
            text = PAGES[program].read_text().replace("\\-", "-")
            if not sub:
                text = text.split("\n.SH OPTIONS")[1].split("\n.SH")[0]
            else:
                self.assertIn(f"\n.SS stereotrack {sub}", text)
                text = text.split(f"\n.SS stereotrack {sub}")[1].split("\n.S")[0]
            self.assertGreater(len(options), 0)
            for option in options - ({"--help"} if sub else set()):
                with self.subTest(program=program, sub=sub, option=option):
                    self.assertRegex(text, rf"(?<![\w-]){option}(?![\w-])")

    def test_nothing_else_stands_in_it(self):
        known = {"stereotrackd": set(), "stereotrack": set()}
        for program, _, options in helps():
            known[program] |= options
        for program, page in PAGES.items():
            told = set(re.findall(r"(?<![\w-])(--[a-z][a-z-]*)", page.read_text().replace("\\-", "-")))
            self.assertLessEqual(told, known[program])

    def test_formatters_find_nothing(self):
        for page in PAGES.values():
            done = run("man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", "-Z", page, env={"LC_ALL": "C.UTF-8", "PATH": "/usr/bin:/bin"})
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            done = run("mandoc", "-T", "lint", "-W", "warning", page)
            self.assertEqual((done.returncode, done.stdout), (0, ""))


class Completion(unittest.TestCase):
    @staticmethod
    def complete(program, *words):
        """What a shell offers for the last word."""
        script = ("source /usr/share/bash-completion/bash_completion; source \"$1\"; shift; COMP_WORDS=(\"$@\")\n"
                  "COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMP_LINE=\"${COMP_WORDS[*]}\"; COMP_POINT=${#COMP_LINE}\n"
                  "_$1; printf '%s\\n' \"${COMPREPLY[@]}\"")
        done = run("bash", "-c", script, "bash", DEBIAN / "completion" / program, program, *words)
        assert done.returncode == 0 and not done.stderr, done.stderr
        return set(done.stdout.split())

    def test_each_option_is_offered(self):
        for program, sub, options in helps():
            with self.subTest(program=program, sub=sub):
                offered = self.complete(program, *([sub] if sub else []), "--")
                self.assertLessEqual(options, offered)
                # Those of the program itself may stand behind a subcommand.
                self.assertLessEqual(offered, options | {"--simd", "--help"})

    def test_subcommands_are_offered(self):
        subs = {sub for program, sub, _ in helps() if program == "stereotrack" and sub}
        self.assertEqual(self.complete("stereotrack", "") & subs, subs)
        self.assertEqual(self.complete("stereotrack", "mo"), {"monitor"})

    def test_values_are_offered(self):
        self.assertEqual(self.complete("stereotrack", "replay", "--pace", ""), {"max", "real"})
        scenes = run(BUILD / "bin/stereotrack", "synth", "--help").stdout.split("name of the scene: ")[1].split("\n")[0]
        self.assertEqual(self.complete("stereotrack", "synth", ""), set(scenes.split(", ")))

    def test_files_are_offered(self):
        with tempfile.TemporaryDirectory() as name:
            pathlib.Path(name, "rig.toml").touch()
            pathlib.Path(name, "rig.txt").touch()
            self.assertEqual(self.complete("stereotrackd", "--config", f"{name}/rig"), {f"{name}/rig.toml"})


class Configuration(unittest.TestCase):
    TEXT = (PROJECT / "systemd/stereotrackd.toml").read_text()

    def check(self, text, *more):
        with tempfile.TemporaryDirectory() as name:
            path = pathlib.Path(name, "rig.toml")
            path.write_text(text)
            return run(BUILD / "bin/stereotrackd", "--config", path, "--check-config", *more)

    def test_as_it_is_installed_it_is_refused_and_names_the_key(self):
        done = self.check(self.TEXT)
        self.assertEqual(done.returncode, 2)
        self.assertIn("camera.left.device", done.stderr)

    def test_each_key_that_it_offers_is_one(self):
        offered = re.findall(r"^#(\w[\w.]* = .*)$", self.TEXT, re.M)
        self.assertGreater(len(offered), 12)
        whole = re.sub(r"^#(\w[\w.]* = |\[\[)", r"\1", self.TEXT, flags=re.M)
        self.assertIn("\nleft.device = ", whole)
        # What is right is refused only by what is not there: 1, not 2.
        done = self.check(whole)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertRegex(done.stderr, "is not there|no such calibration file")
        # And a key that is none is found.
        self.assertEqual(self.check(whole.replace("tolerance", "tolerence")).returncode, 2)

    def test_what_it_says_of_a_scene_is_fine(self):
        with tempfile.TemporaryDirectory() as name:
            whole = re.sub(r"^#(\w[\w.]* = |\[\[)", r"\1", self.TEXT, flags=re.M)
            scene = whole.replace('name = "cameras"', 'name = "synthetic:eleven"')
            scene = scene.replace("/etc/stereotrack/calibration.yml", f"{name}/scene/calibration.yml")
            run(BUILD / "bin/stereotrack", "synth", "eleven", "--out", f"{name}/scene", "--frames", "1")
            done = self.check(scene)
            self.assertEqual(done.returncode, 0, done.stderr)

    def test_it_is_the_conffile(self):
        self.assertEqual((DEBIAN / "stereotrack/conffiles").read_text(), "/etc/stereotrack/stereotrackd.toml\n")


class Changelog(unittest.TestCase):
    def test_dpkg_reads_it(self):
        with tempfile.TemporaryDirectory() as name:
            out = pathlib.Path(name, "changelog")
            done = run(sys.executable, DEBIAN / "changelog.py", PROJECT / "CHANGELOG.md", out)
            self.assertEqual(done.returncode, 0, done.stderr)
            told = run("dpkg-parsechangelog", "-l", out)
            self.assertEqual(told.stderr, "")
            version = re.search(r"project\(stereotrack VERSION (\S+)", (PROJECT / "CMakeLists.txt").read_text())[1]
            self.assertIn(f"\nVersion: {version}\n", told.stdout)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
