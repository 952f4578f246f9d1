#!/usr/bin/env python3
"""Feeds check_rules.py trees that break one rule each, and trees that only look as if. A rule that stays silent fails."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parent / "check_rules.py"
HEADER = "#pragma once\n"


def check(files):
    """Writes FILES (name: text) and answers the findings as a list of 'file [rule]'."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            path = pathlib.Path(folder, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode() if isinstance(text, str) else text)
        done = subprocess.run([sys.executable, SCRIPT, "--root", folder], capture_output=True, text=True, check=False)
    found = []
    for line in done.stdout.splitlines()[:-1]:
        place, rest = line.split(": [", 1)
        found.append(f"{place.split(':')[0]} [{rest.split(']')[0]}]")
    assert done.returncode == (1 if found else 0), done.stdout + done.stderr
    return found


def include(target):
    return f'#include "{target}"\n'


class Refused(unittest.TestCase):
    def refuses(self, rule, files, where=None):
        self.assertIn(f"{where or next(iter(files))} [{rule}]", check(files))

    def test_arrows_that_point_the_wrong_way(self):
        for name, target in [
            ("pipeline/track/a.cpp", "config/schema.hpp"),
            ("pipeline/track/a.cpp", "drivers/capture/frame_source.hpp"),
            ("pipeline/track/a.cpp", "firmware-app/stereotrack/rig.hpp"),
            ("pipeline/core/a.cpp", "pipeline/track/tracker.hpp"),
            ("pipeline/core/a.cpp", "pipeline/frame.hpp"),
            ("drivers/capture/a.cpp", "config/schema.hpp"),
            ("drivers/capture/a.cpp", "firmware-app/stereotrack/rig.hpp"),
            ("config/a.cpp", "drivers/capture/frame_source.hpp"),
            ("config/a.cpp", "firmware-app/render/renderer.hpp"),
            ("firmware-app/render/a.cpp", "tests/support/temp_dir.hpp"),
            ("config/a.cpp", "../pipeline/frame.hpp"),
        ]:
            with self.subTest(name=name, target=target):
                self.refuses("arrow", {name: include(target)})
                self.refuses("arrow", {name: include(target).replace('"', "<", 1).replace('"', ">")})

    def test_a_pipeline_that_is_not_pure(self):
        for header in ["<opencv2/core.hpp>", "<iostream>", "<fstream>", "<thread>", "<mutex>", "<unistd.h>",
                       "<sys/mman.h>", "<vector>", "<string>", "<unordered_map>", "<functional>", "<cstdio>",
                       '"opencv2/core.hpp"']:
            with self.subTest(header=header):
                self.refuses("pure", {"pipeline/track/a.cpp": f"#include {header}\n"})
                self.refuses("pure", {"pipeline/core/a.hpp": HEADER + f"  #  include {header}\n"})

    def test_atomics_in_a_stage(self):
        self.refuses("pure", {"pipeline/track/a.cpp": "#include <atomic>\n"})

    def test_rooms_that_include_each_other(self):
        files = {"pipeline/track/a.cpp": include("pipeline/shape/b.hpp"),
                 "pipeline/shape/b.hpp": HEADER + include("pipeline/motion/c.hpp"),
                 "pipeline/motion/c.hpp": HEADER + include("pipeline/track/d.hpp")}
        self.refuses("circle", files, "pipeline/motion")

    def test_value_of_a_result(self):
        for call in ["r.value()", "r->value()", "r . value ( )", "std::move(r).value()"]:
            with self.subTest(call=call):
                self.refuses("value", {"pipeline/track/a.cpp": f"int f() {{ return {call}; }}\n"})
        self.refuses("value", {"firmware-app/runtime/loop_rt.cpp": "int f() { return r.value(); }\n"})

    def test_virtual_in_the_pipeline(self):
        self.refuses("virtual", {"pipeline/track/a.hpp": HEADER + "struct A { virtual void f(); };\n"})

    def test_stage_whose_functions_nobody_checks(self):
        stage = "struct A { static Result<A> create(int,\n Arena& arena) noexcept; void run() noexcept; };\n"
        for text in [stage, stage + "// static_assert(RealTimeStage<A, &A::run>);\n",
                     stage + "static_assert(RealTimeStage<AB, &AB::run>);\n"]:
            with self.subTest(text=text):
                self.refuses("stage", {"pipeline/track/a.hpp": HEADER + text})
        self.assertFalse(check({"pipeline/track/a.hpp": HEADER + stage + "static_assert(RealTimeStage<A, &A::run>);\n",
                                "pipeline/track/b.hpp": HEADER + "struct B { static Result<B> create(int a); };\n",
                                "drivers/c.hpp": HEADER + stage}))

    def test_nolint_without_check_or_reason(self):
        for note in ["NOLINT", "NOLINTNEXTLINE", "NOLINT(misc-x)", "NOLINT: because of that", "NOLINTBEGIN(misc-x)",
                     "NOLINT(): because of that"]:
            with self.subTest(note=note):
                self.refuses("nolint", {"config/a.cpp": f"int a;  // {note}\n"})

    def test_todo_without_reason(self):
        for note in ["TODO", "TODO: later", "FIXME(why it stays so): what", "TODO(me): what"]:
            with self.subTest(note=note):
                self.refuses("todo", {"config/a.cpp": f"int a;  // {note}\n"})

    def test_whitespace(self):
        for text in ["int a;\t\n", "int a; \n", "int a;\r\n", "int a;"]:
            with self.subTest(text=text):
                self.refuses("whitespace", {"config/a.cpp": text})
                self.refuses("whitespace", {"docs/a.md": text})

    def test_paths_of_one_machine(self):
        for path in ["/root/x", "/home/somebody/x", "/work/main", "/Users/x"]:
            with self.subTest(path=path):
                self.refuses("machine-path", {"config/a.cpp": f'const char* a = "{path}";\n'})

    def test_header_without_guard(self):
        self.refuses("guard", {"config/a.hpp": "int a();\n"})
        self.assertFalse(check({"pipeline/a-inl.hpp": "#if defined(A) == defined(HWY_TARGET_TOGGLE)\n#endif\n"}))

    def test_tests_that_no_list_names(self):
        self.refuses("unregistered-test", {"tests/unit/x/a_test.cpp": "int a;\n", "tests/unit/x/CMakeLists.txt": "\n"})
        self.refuses("unregistered-test", {"tests/unit/x/test_a.py": "a = 1\n",
                                           "tests/unit/y/CMakeLists.txt": "add_test(test_a.py)\n"})

    def test_links_to_nowhere(self):
        self.refuses("link", {"README.md": "see [this](docs/NOWHERE.md)\n"})
        self.refuses("link", {"docs/A.md": "![picture](pictures/none.png)\n"})

    def test_text_that_is_not_utf8(self):
        self.refuses("encoding", {"config/a.cpp": b"// caf\xe9\n"})


class Accepted(unittest.TestCase):
    def test_what_only_looks_like_a_breach(self):
        self.assertEqual(check({
            "pipeline/core/result.hpp": HEADER + "/// .value() is banned, and so is virtual.\n#include <span>\n",
            "pipeline/core/ring.hpp": HEADER + "#include <atomic>\n",
            "pipeline/track/a.cpp": '#include "pipeline/core/result.hpp"\n#include <Eigen/Core>\nint value(int x);\n',
            "pipeline/shape/b.hpp": HEADER + '#include "pipeline/core/result.hpp"\n',
            "config/a.cpp": "int a;  // NOLINT(misc-x): the schema wants this name\n",
            "config/b.cpp": "int a;  // TODO(the board's clock is not known yet): take it\n"
                            '#include "pipeline/frame.hpp"\nint b = r.value();\n',
            "firmware-app/a.cpp": '#include "config/a.hpp"\n#include "drivers/a.hpp"\n#include <iostream>\n',
            "tests/unit/x/a_test.cpp": '#include "firmware-app/a.hpp"\n',
            "tests/unit/x/CMakeLists.txt": "stereotrack_test(a SOURCES a_test.cpp)\n",
            "README.md": "[this](docs/A.md#part) [that](https://example.org/none)\n",
            "docs/A.md": "text\n",
        }), [])


if __name__ == "__main__":
    unittest.main(verbosity=1)
