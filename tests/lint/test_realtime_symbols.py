#!/usr/bin/env python3
"""Breaks each rule of check_realtime_symbols.py with code compiled on the spot, and shows it code that keeps them.

The compiler is $CXX, else c++.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parent / "check_realtime_symbols.py"
CXX = os.environ.get("CXX", "c++")
SECTIONS = ("-ffunction-sections", "-fdata-sections")

# name: (code, what the message must name). Each has the root `int loop(int)`.
BAD = {
    "new": ("int* p; int loop(int a) { p = new int(a); return 0; }", "operator new("),
    "delete": ("int* p; int loop(int) { delete p; return 0; }", "operator delete("),
    "new without exception":
        ("#include <new>\nint* p; int loop(int a) { p = new (std::nothrow) int(a); return 0; }", "std::nothrow"),
    "malloc": ("#include <cstdlib>\nvoid* p; int loop(int a) { p = std::malloc(a); return 0; }", "malloc"),
    "free": ("#include <cstdlib>\nvoid* p; int loop(int) { std::free(p); return 0; }", "free"),
    "mmap": ("#include <sys/mman.h>\nvoid* p; int loop(int a) { p = mmap(nullptr, a, PROT_READ, MAP_PRIVATE | "
             "MAP_ANONYMOUS, -1, 0); return 0; }", "mmap"),
    "vector": ("#include <vector>\nint loop(int a) { std::vector<int> v(a); return v.data()[a / 2]; }", "operator new("),
    "string": ("#include <string>\nstd::string s; int loop(int a) { s.append(a, 'a'); return 0; }", "std::__cxx11::"),
    "stable_sort":
        ("#include <algorithm>\nint v[99]; int loop(int a) { std::stable_sort(v, v + a); return v[0]; }", "operator new("),
    "function": ("#include <functional>\nint call(const std::function<int(int)>& f); int loop(int a) { int b = a, c = a, "
                 "d = a, e = a, g = a; return call([=](int x) { return x + b + c + d + e + g; }); }", "operator new("),
    "call of an empty function": ("#include <functional>\nstd::function<int(int)> f; int loop(int a) { return f(a); }",
                                  "std::__throw_bad_function_call"),
    "mutex": ("#include <mutex>\nstd::mutex m; int loop(int a) { const std::lock_guard<std::mutex> l(m); return a; }",
              "pthread_mutex_lock"),
    "condition variable": ("#include <condition_variable>\nstd::condition_variable c; int loop(int a) { c.notify_one(); "
                           "return a; }", "std::condition_variable::notify_one"),
    "thread": ("#include <thread>\nint loop(int a) { std::thread([] {}).join(); return a; }", "std::thread::"),
    "sleep": ("#include <unistd.h>\nint loop(int a) { usleep(a); return 0; }", "usleep"),
    "clock": ("#include <chrono>\nint loop(int a) { return a + "
              "std::chrono::steady_clock::now().time_since_epoch().count(); }", "steady_clock::now"),
    "clock of the system": ("#include <ctime>\nint loop(int a) { timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return a "
                            "+ t.tv_nsec; }", "clock_gettime"),
    "printf": ("#include <cstdio>\nint loop(int a) { return std::printf(\"%d\", a); }", "printf"),
    "stream": ("#include <iostream>\nint loop(int a) { std::cout << a; return 0; }", "std::cout"),
    "file": ("#include <cstdio>\nint loop(int) { return std::fopen(\"a\", \"r\") != nullptr; }", "fopen"),
    "system call": ("#include <unistd.h>\nint loop(int a) { return write(1, &a, 4); }", "write"),
    "locale": ("#include <locale>\nint loop(int a) { return std::locale() == std::locale::classic() ? a : 0; }",
               "std::locale::"),
    "environment": ("#include <cstdlib>\nint loop(int) { return std::getenv(\"A\") != nullptr; }", "getenv"),
    "guarded static": ("int make(int); int loop(int a) { static const int b = make(a); return b; }",
                       "__cxa_guard_acquire"),
    "throw": ("int loop(int a) { if (a > 3) throw a; return a; }", "__cxa_"),
    "exception of the library": ("#include <optional>\nstd::optional<int> o; int loop(int) { return o.value(); }",
                                 "__cxa_"),
    "dynamic_cast": ("struct A { virtual ~A(); }; struct B : A { int b; }; A* p; int loop(int) { return "
                     "dynamic_cast<B*>(p) != nullptr; }", "__dynamic_cast"),
    "sine": ("#include <cmath>\nint loop(int a) { return std::sin(double(a)) > 0.5; }", "sin"),
    "abort": ("#include <cstdlib>\nint loop(int a) { if (a > 3) std::abort(); return a; }", "abort"),
    "thread's own variable elsewhere": ("extern thread_local int t; int loop(int a) { return t + a; }", "TLS"),
    # The ways that lead there.
    "through a function": ("#include <cstdlib>\nvoid* p; __attribute__((noinline)) static void f(int a) { p = "
                           "std::malloc(a); }\nint loop(int a) { f(a); return 0; }", "f: calls malloc; from loop"),
    "through a table of functions": (
        "#include <cstdlib>\nstatic void* f(unsigned long a) { return std::malloc(a); }\nstatic void* g(unsigned long) { "
        "return nullptr; }\nstatic void* (*const kTable[])(unsigned long) = {g, f};\nint loop(int a) { return "
        "kTable[a](3) != nullptr; }", "malloc"),
    "through the library's function in a table": (
        "#include <cstdlib>\nvoid* (*const kTable[])(unsigned long) = {std::malloc, std::malloc};\nint loop(int a) { "
        "return kTable[a](3) != nullptr; }", "malloc"),
    "in a part that is rarely run": (
        "#include <cstdlib>\nvoid* p; int loop(int a) { if (__builtin_expect(a > 3, 0)) { p = std::malloc(a); } return a; "
        "}", "malloc"),
    "through a virtual function": (
        "#include <cstdlib>\nstruct A { virtual void* f(); };\nvoid* A::f() { return std::malloc(3); }\nint loop(int) { "
        "A a; A* volatile p = &a; return p->f() != nullptr; }", "malloc"),
    "through an inline function": (
        "#include <cstdlib>\ntemplate <class T> __attribute__((noinline)) inline T* f(T a) { return "
        "(T*)std::malloc(a); }\nint loop(int a) { return *f(a); }", "malloc"),
    # What set-up may not do either.
    "malloc in set-up": ("#include <cstdlib>\nint loop(int a) { return a; }\nvoid* create() { return std::malloc(3); }",
                         "create: calls malloc; set-up"),
    "printf in set-up": ("#include <cstdio>\nint loop(int a) { return a; }\nvoid create() { std::puts(\"a\"); }", "puts"),
    "printf at the program's start": (
        "#include <cstdio>\nstatic const int kA = std::printf(\"a%d\", 3);\nint loop(int a) { return a + kA; }", "printf"),
}
GOOD = {
    "arithmetic and the compiler's own functions": """
#include <algorithm>
#include <cmath>
#include <cstring>
struct Big { int a[300]; };
Big from, to;
int numbers[100];
int loop(int a) {
  to = from;
  std::memset(numbers, 0, a);
  std::sort(numbers, numbers + a);
  static int calls = 3;
  ++calls;
  return static_cast<int>(std::sqrt(double(a)) + std::floor(a / 7.0)) + calls + std::memcmp(&from, &to, a);
}
""",
    "set-up that takes the arena's memory": """
#include <new>
int loop(int a) { return a; }
void* create() { return ::operator new(64, std::align_val_t{64}, std::nothrow); }
void destroy(void* p) { ::operator delete(p, std::align_val_t{64}); }
""",
    "large switch, whose table stands beside others'": """
#include <new>
void* create(int a) {
  switch (a) {
    case 0: return ::operator new(64, std::align_val_t{64}, std::nothrow);
    case 1: return ::operator new(65, std::align_val_t{64}, std::nothrow);
    case 2: return ::operator new(66, std::align_val_t{32}, std::nothrow);
    case 3: return nullptr;
    case 4: return ::operator new(67, std::align_val_t{64}, std::nothrow);
    case 5: return ::operator new(99, std::align_val_t{64}, std::nothrow);
  }
  return ::operator new(67, std::align_val_t{64}, std::nothrow);
}
int numbers[9];
int loop(int a) {
  switch (a) {
    case 0: return numbers[3];
    case 1: numbers[4] += 2; return 7;
    case 2: numbers[5] /= 3; break;
    case 3: return numbers[7] * numbers[2];
    case 4: numbers[8] = a; break;
    case 5: return 99;
  }
  return a;
}
""",
}


class Snippets(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def compile(self, code, flags=("-c", *SECTIONS), name="snippet.o"):
        out = pathlib.Path(self.folder.name, name)
        done = subprocess.run([CXX, "-std=c++20", "-O2", "-w", *flags, "-x", "c++", "-", "-o", out], input=code + "\n",
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return out

    def check(self, *objects, root="loop(", threads=False):
        return subprocess.run([sys.executable, SCRIPT, *["--threads"] * threads, "--root", root, *objects],
                              capture_output=True, text=True, check=False)

    def test_each_breach_is_refused_by_name(self):
        for name, (code, said) in BAD.items():
            with self.subTest(name=name):
                done = self.check(self.compile(code))
                self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
                self.assertIn("snippet.o: ", done.stdout)
                self.assertIn(said, done.stdout)

    def test_code_that_keeps_the_rules_passes(self):
        for name, code in GOOD.items():
            with self.subTest(name=name):
                done = self.check(self.compile(code))
                self.assertEqual((done.returncode, done.stderr), (0, ""), done.stdout)

    def test_breach_in_another_object_is_found_with_the_way_to_it(self):
        one = self.compile("int far(int); int loop(int a) { return far(a) + 1; }", name="one.o")
        two = self.compile("int more(int); int far(int a) { return more(a) + 1; }", name="two.o")
        three = self.compile("int* p; int more(int a) { p = new int(a); return a; }", name="three.o")
        done = self.check(one, two, three)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stdout, r"(?m)^three\.o: more: calls operator new\(unsigned \w+\); from loop > far$")

    def test_what_no_object_has_is_refused(self):
        done = self.check(self.compile("int far(int); int loop(int a) { return far(a) + 1; }"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("calls far(int)", done.stdout)

    def test_threads_may_sleep_and_send_and_their_set_up_may_do_anything(self):
        code = """
#include <ctime>
#include <sys/socket.h>
#include <vector>
int loop(int a) {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
  return sendto(a, &t, sizeof t, 0, nullptr, 0);
}
std::vector<int> create(int a) { return std::vector<int>(a); }
"""
        done = self.check(self.compile(code), threads=True)
        self.assertEqual((done.returncode, done.stderr), (0, ""), done.stdout)
        self.assertEqual(self.check(self.compile(code)).returncode, 1)

    def test_threads_are_refused_what_may_wait_for_others(self):
        for name in ("new", "delete", "malloc", "vector", "mutex", "condition variable", "printf", "throw", "file"):
            code, said = BAD[name]
            with self.subTest(name=name):
                done = self.check(self.compile(code), threads=True)
                self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
                self.assertIn(said, done.stdout)

    def test_objects_that_cannot_be_judged_are_refused(self):
        good = "int loop(int a) { return a; }\nint main() { return loop(3); }"
        for name, done in {
            "no root": self.check(self.compile(good), root="other("),
            "threads that are not there": subprocess.run([sys.executable, SCRIPT, "--threads", self.compile(good)],
                                                         capture_output=True, text=True, check=False),
            "one section for all functions": self.check(self.compile(good, flags=("-c",))),
            "a program": self.check(self.compile(good, flags=SECTIONS)),
            "no object": self.check(SCRIPT),
        }.items():
            with self.subTest(name=name):
                self.assertEqual(done.returncode, 2, done.stdout)
                self.assertTrue(done.stderr.startswith("check_realtime_symbols.py: "), done.stderr)


if __name__ == "__main__":
    unittest.main()
