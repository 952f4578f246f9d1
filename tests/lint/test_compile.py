#!/usr/bin/env python3
"""What the compiler must refuse in pipeline/, with the very flags that it is built with: test_compile.py BUILD

A stage one of whose functions loses noexcept, or that owns memory, does not compile (pipeline/core/stage.hpp); nor do
exceptions and RTTI.
"""
import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv.pop(1)).resolve()
ASSERT = re.compile(r"^static_assert\(RealTimeStage<(\w+),([^;]*)>\);$", re.M)

BAD = {
    "throw": ("int f(int a) { if (a > 3) throw 3; return a; }", "exception"),
    "try": ("int f(int a) { try { return a; } catch (int) { return 3; } }", "exception"),
    "typeid": ("#include <typeinfo>\nbool f(int a) { return typeid(a) == typeid(3); }", "rtti"),
    "dynamic_cast": ("struct A { virtual void f(); }; struct B : A {}; B* f(A* a) { return dynamic_cast<B*>(a); }",
                     "rtti"),
    "Result that nobody looks at": ('#include "pipeline/core/result.hpp"\n'
                                    "[[nodiscard]] stereotrack::Result<int> f(); void g() { f(); }", "nodiscard"),
    "function that may throw": ('#include "pipeline/core/stage.hpp"\nstruct A { void run(); };\n'
                                "static_assert(stereotrack::RealTimeStage<A, &A::run>);", "static.assert"),
    "const function that may throw": ('#include "pipeline/core/stage.hpp"\nstruct A { void run(int) const; };\n'
                                      "static_assert(stereotrack::RealTimeStage<A, &A::run>);",
                                      "static.assert"),
    "static function that may throw": ('#include "pipeline/core/stage.hpp"\nstruct A { static int run(); };\n'
                                       "static_assert(stereotrack::RealTimeStage<A, &A::run>);",
                                       "static.assert"),
    "second of two functions that may throw":
        ('#include "pipeline/core/stage.hpp"\nstruct A { void run() noexcept; void learn(); };\n'
         "static_assert(stereotrack::RealTimeStage<A, &A::run, &A::learn>);", "static.assert"),
    "no function": ('#include "pipeline/core/stage.hpp"\nstruct A {};\nstatic_assert(stereotrack::RealTimeStage<A>);',
                    "static.assert"),
    "stage that owns memory":
        ('#include "pipeline/core/stage.hpp"\n#include <vector>\nstruct A { void run() noexcept; std::vector<int> a; };\n'
         "static_assert(stereotrack::RealTimeStage<A, &A::run>);", "static.assert"),
    "virtual stage":
        ('#include "pipeline/core/stage.hpp"\nstruct A final { virtual void run() noexcept; };\n'
         "static_assert(stereotrack::RealTimeStage<A, &A::run>);", "static.assert"),
}
GOOD = """#include "pipeline/core/stage.hpp"
struct A { int run(int) noexcept; void show() const noexcept; static int measure(int, int) noexcept; };
static_assert(stereotrack::RealTimeStage<A, &A::run, &A::show, &A::measure>);
"""


def flags():
    """Those of pipeline/pipeline.cpp, without its name and its output."""
    for entry in json.loads((BUILD / "compile_commands.json").read_text()):
        if pathlib.Path(entry["file"]) == ROOT / "pipeline/pipeline.cpp":
            words = shlex.split(entry["command"])
            words = [w for w in words if w != "ccache" and not w.endswith("/ccache")]
            return words[:words.index("-o")], entry["directory"]
    raise AssertionError("no command for pipeline/pipeline.cpp")


class Compile(unittest.TestCase):
    def compile(self, code, first_folder=None):
        words, directory = flags()
        if first_folder:
            words.insert(1, f"-I{first_folder}")
        return subprocess.run([*words, "-fsyntax-only", "-x", "c++", "-"], input=code + "\n", cwd=directory,
                              capture_output=True, text=True, check=False)

    def test_bad_code_is_refused(self):
        for name, (code, said) in BAD.items():
            with self.subTest(name=name):
                done = self.compile(code)
                self.assertNotEqual(done.returncode, 0)
                self.assertRegex(done.stderr, said)

    def test_good_code_passes(self):
        done = self.compile(GOOD)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_each_stage_is_refused_once_one_of_its_functions_lost_noexcept(self):
        """In copies of the headers, found before the real ones: each function that an assertion names, one of each
        stage at a time."""
        headers = [p for p in sorted(ROOT.glob("pipeline/**/*.hpp")) if ASSERT.search(p.read_text())]
        self.assertGreaterEqual(len(headers), 20)
        turns = []  # of each turn: {header's name: text}, {(header's name, line of the assertion): what is broken}
        for header in headers:
            text = header.read_text()
            name = str(header.relative_to(ROOT))
            for found in ASSERT.finditer(text):
                stage, functions = found.groups()
                begin = re.search(rf"^(class|struct) {stage}\b[^;]*?{{", text, re.M)
                end = text.index("\n};\n", begin.end())
                line = text.count("\n", 0, found.start()) + 1
                for turn, function in enumerate(sorted(set(re.findall(rf"{stage}::(\w+)", functions)))):
                    at = re.compile(rf"\b{function}\([^;]*?\)(?: const)?( noexcept)").search(text, begin.end(), end)
                    self.assertIsNotNone(at, f"{name}: {function}")
                    if turn == len(turns):
                        turns.append(({}, {}))
                    texts, broken = turns[turn]
                    kept = texts.get(name, text)
                    # As long as before: what another stage of this header loses is where it was.
                    texts[name] = kept[:at.start(1)] + " " * len(at.group(1)) + kept[at.end(1):]
                    broken[name, line] = f"{stage}_{function}"
        for texts, broken in turns:
            with tempfile.TemporaryDirectory() as folder:
                for name, text in texts.items():
                    copy = pathlib.Path(folder, name)
                    copy.parent.mkdir(parents=True, exist_ok=True)
                    copy.write_text(text)
                done = self.compile("".join(f'#include "{name}"\n' for name in texts), folder)
            self.assertNotEqual(done.returncode, 0)
            self.assertIn("RealTimeStage", done.stderr)
            for (name, line), what in broken.items():
                with self.subTest(what=what):
                    self.assertRegex(done.stderr, rf"{re.escape(name)}:{line}:\d+: error: static assertion failed")


if __name__ == "__main__":
    unittest.main()
