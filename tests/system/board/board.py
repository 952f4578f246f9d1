#!/usr/bin/env python3
"""The emulated board: 64-bit ARM, Debian 12, or Debian 13 with a PREEMPT_RT kernel, two cameras of the kernel's own (vivid),
and more: guest/devices.

    board.py make                                      image and saved state, where they do not fit the scripts
    board.py run [OPTIONS] PROGRAM [ARGUMENT...]       a program (or script) of the host on a fresh board, as root in
                                                       /payload; its output and its exit code
      --with PATH                    a file or folder that comes along; again for more
      --results FOLDER               what the program left in /run/results
      --time-limit SECONDS           of the board's clock (60): then it says what hangs, exit code 124
      --clock steady|real            default steady
      --board debian12|debian13      of make, run, test and targets; default debian12
  board.py test [--build FOLDER] [--junit FILE] [GROUP|GROUP/CASE]...
                                                       the cases (all), each on a fresh board; exit code 1 where one
                                                       fails or there is none; what they left:
                                                       build/board-results/NAME; at the end: how long each took
      --jobs N                       boards at a time: one a core (4 at most), with the real clock one
  board.py targets [GROUP|GROUP/CASE]...               the CMake targets that the cases want

A case is cases/GROUP/CASE.sh. It prints TAP (guest/tap.sh) and says in its head, in comments: "# wants: bin/PROGRAM ..."
what it wants of the build folder (packages/NAME: the .deb of that name), "# brings: PATH ..." what of the project's files
the programs read (they find them where they were when they were built), "# limit: SECONDS" of the board's clock (120),
"# boards: NAME ..." where it runs (all), "# wants on NAME: ..." what it wants only there,
"# power cuts: N" how often it asks for one (0): the emulator is killed, the board boots anew with the disks as they are,
and the case is called again, its first argument the number of cuts so far. "# only by name: WHY" leaves it out unless it is
named itself.

Everything lies in build/board/NAME, or NAME in the folder STEREOTRACK_BOARD_CACHE. The board is booted once and its state
is saved; each run starts from there, in seconds, on disks that forget. No board outlives board.py.

Clocks. steady: time is the count of instructions, two nanoseconds each on one host thread, and idle time is skipped: 40 ms
between frames are 40 ms however busy the host is. What waits for a disk sees time leap: read files before it counts.
real: the host's clock, a host thread a core.
"""
import argparse
import concurrent.futures
import contextlib
import ctypes
import fcntl
import hashlib
import json
import os
import pathlib
import re
import select
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tarfile
import tempfile
import time
import typing
import xml.etree.ElementTree as xml

HERE = pathlib.Path(__file__).resolve().parent
PROJECT = HERE.parents[2]
CACHE = pathlib.Path(os.environ.get("STEREOTRACK_BOARD_CACHE") or PROJECT / "build/board").resolve()
CLOCKS = {"steady": ["-accel", "tcg,thread=single", "-icount", "shift=1,sleep=off"], "real": ["-accel", "tcg,thread=multi"]}
# Name -> Debian's name of the release, and the preset of the programs for it.
BOARDS = {"debian12": ("bookworm", "aarch64"), "debian13": ("trixie", "aarch64-debian13")}
# The saved state knows the size of the disk that it will find.
PAYLOAD_SIZE = 2 << 30
DATA_SIZE = 512 << 20
# Ten seconds on a quiet host.
BOOT_LIMIT_S = 900
# Of the host, beyond the time limit of the board's clock: an emulator on a busy host.
HOST_FACTOR = 10
HUNG = 124
# Of memory, a board has 1 GB.
MOST_JOBS = 4
# Loaded before there are threads: a child between fork and exec may not load it.
LIBC = ctypes.CDLL(None)
CUT = re.compile(r"board: cut the power after (\d+) facts and (\d+) s")


class BoardError(Exception):
    """One line that says what is wrong."""


class UsageError(BoardError):
    """The same, of what was asked for."""


class Board(typing.NamedTuple):
    """Which board, and by which clock it runs."""
    name: str
    clock: str

    @property
    def folder(self):
        return CACHE / self.name


def note(text):
    print(f"board: {text}", file=sys.stderr, flush=True)


def die_with_parent():
    """In the child: SIGKILL when board.py, or the thread of it that began the child, is gone, however it went."""
    pr_set_pdeathsig = 1
    LIBC.prctl(pr_set_pdeathsig, signal.SIGKILL)


def machine_options(board, folder, disk, forgetful, kernel_words=""):
    """Of the emulator: a board with its files in `folder`. forgetful: what it writes to `disk` is not kept. Of raw disks,
    as the data disk is, what the board has written outlives the emulator, however that ends: the host has it. So there is
    nothing to wait for, which would make time leap."""
    disk_kind = "format=raw,cache=unsafe" if pathlib.Path(disk).suffix == ".raw" else "format=qcow2"
    return [
        "-M", "virt", "-cpu", "cortex-a72", *CLOCKS[board.clock], "-smp", "2", "-m", "1024",
        "-nodefaults", "-nographic", "-no-reboot", "-monitor", "none", "-serial", f"file:{folder}/console.log",
        "-qmp", f"unix:{folder}/qmp,server=on,wait=off",
        "-kernel", str(board.folder / "vmlinuz"), "-initrd", str(board.folder / "initrd.gz"),
        "-append", f"console=ttyAMA0 loglevel=4 panic=1 systemd.show_status=0 {kernel_words}".rstrip(),
        "-drive", f"file={disk},if=none,id=root,{disk_kind}" + (",snapshot=on" if forgetful else ""),
        "-device", "virtio-blk-pci,drive=root",
        "-drive", f"file={folder}/payload.ext4,if=none,id=payload,format=raw,readonly=on",
        "-device", "virtio-blk-pci,drive=payload",
        "-drive", f"file={folder}/data.ext4,if=none,id=data,format=raw,cache=unsafe",
        "-device", "virtio-blk-pci,drive=data", "-device", "virtio-rng-pci", "-device", "virtio-serial-pci",
        "-chardev", "stdio,id=control,signal=off", "-device", "virtserialport,chardev=control,name=board.control",
        "-chardev", f"file,id=files,path={folder}/files.tar", "-device", "virtserialport,chardev=files,name=board.files"]


class Machine:
    """A running emulator. Its control port is its standard input and output; lines of "board: " are the agent's."""

    def __init__(self, folder, options):
        self.console = folder / "console.log"
        self.qmp = folder / "qmp"
        self.buffer = b""
        command = ["qemu-system-aarch64", *options]
        environment = {**os.environ, "TMPDIR": str(folder)}
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment,
                                        preexec_fn=die_with_parent)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def say(self, text):
        self.process.stdin.write(f"{text}\n".encode())
        self.process.stdin.flush()

    def lines(self, deadline):
        """Lines of the control port, without their ends; raises BoardError at the deadline (of time.monotonic)."""
        out = self.process.stdout.fileno()
        while True:
            while b"\n" in self.buffer:
                line, self.buffer = self.buffer.split(b"\n", 1)
                yield line.decode(errors="replace").rstrip("\r")
            if not select.select([out], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise TimeoutError
            got = os.read(out, 1 << 16)
            if not got:
                raise BoardError(f"the emulator ended by itself (code {self.process.wait()}); the board's console:\n"
                                 + self.console_tail())
            self.buffer += got

    def console_tail(self):
        text = self.console.read_text(errors="replace") if self.console.exists() else ""
        return "\n".join(text.splitlines()[-60:]) or "(nothing)"

    def ask(self, connection, command, **arguments):
        """One QMP command's answer; events are passed over."""
        connection.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        connection.flush()
        for line in connection:
            answer = json.loads(line)
            if "error" in answer:
                raise BoardError(f"the emulator refuses {command}: {answer['error']['desc']}")
            if "return" in answer:
                return answer["return"]
        raise BoardError(f"the emulator is gone at {command}")

    def save(self, path):
        """The machine's state into a file; the machine stands still after it."""
        with socket.socket(socket.AF_UNIX) as plug:
            plug.connect(str(self.qmp))
            with plug.makefile("rw") as connection:
                connection.readline()
                self.ask(connection, "qmp_capabilities")
                self.ask(connection, "migrate-set-parameters", **{"max-bandwidth": 4 << 30})
                self.ask(connection, "migrate", uri=f"exec:cat >{shlex.quote(str(path))}")
                while (state := self.ask(connection, "query-migrate")["status"]) != "completed":
                    if state not in ("setup", "active", "device", "pre-switchover"):
                        raise BoardError(f"saving the board's state: {state}")
                    time.sleep(0.1)


def make(board):
    """Image and saved state; (disk, state) to start from."""
    board.folder.mkdir(parents=True, exist_ok=True)
    # One maker at a time. The lock goes with its file object.
    with open(board.folder / "saved.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return make_alone(board)


def sweep(cache):
    """Removes what runs left that were killed. Who is alive has a lock on its folder, or made it just now."""
    for folder in [*cache.glob("run-*"), *cache.glob("saving-*")]:
        try:
            if time.time() - folder.stat().st_mtime > 60:
                with locked(folder, fcntl.LOCK_NB):
                    shutil.rmtree(folder)
        except OSError:
            pass


@contextlib.contextmanager
def locked(folder, how=0):
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | how)
        yield
    finally:
        os.close(handle)


def make_alone(board):
    cache, clock = board.folder, board.clock
    sweep(cache)
    subprocess.run([HERE / "make_image.sh", cache, BOARDS[board.name][0]], check=True, stdout=sys.stderr)
    version = subprocess.run(["qemu-system-aarch64", "--version"], check=True, capture_output=True, text=True).stdout
    key = " ".join([(cache / "id").read_text(), version, *map(str, machine_options(board, "", "", True)), str(PAYLOAD_SIZE),
                    str(DATA_SIZE)])
    folder = cache / f"saved-{clock}-{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    disk, state = folder / "disk.qcow2", folder / "state"
    if folder.exists():
        return disk, state
    note(f"booting {board.name} once, clock {clock}, to save the state")
    work = pathlib.Path(tempfile.mkdtemp(dir=cache, prefix="saving-"))
    try:
        begin = time.monotonic()
        # A name of its own: an image made anew does not pull the disk away from under a saved state.
        os.link(cache / "root.ext4", work / "root.ext4")
        subprocess.run(["qemu-img", "create", "-q", "-f", "qcow2", "-b", "root.ext4", "-F", "raw", work / "disk.qcow2"],
                       check=True)
        for name, size in (("payload.ext4", PAYLOAD_SIZE), ("data.ext4", DATA_SIZE)):
            (work / name).touch()
            os.truncate(work / name, size)
        with Machine(work, machine_options(board, work, work / "disk.qcow2", False)) as machine:
            try:
                for line in machine.lines(begin + BOOT_LIMIT_S):
                    note(line.removeprefix("board: "))
                    if line == "board: ready":
                        break
                    if line == "board: no devices":
                        raise BoardError("guest/devices failed, see above")
            except TimeoutError:
                raise BoardError(f"the board did not boot in {BOOT_LIMIT_S} s; its console:\n"
                                 + machine.console_tail()) from None
            machine.save(work / "state")
        for name in ("payload.ext4", "data.ext4", "files.tar", "qmp"):
            (work / name).unlink(missing_ok=True)
        for old in cache.glob(f"saved-{clock}-*"):
            shutil.rmtree(old)
        work.rename(folder)
        note(f"state saved after {time.monotonic() - begin:.0f} s")
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return disk, state


def add(source, target):
    """A link where it can be, else a copy."""
    source = pathlib.Path(source)
    if not source.exists():
        raise UsageError(f"{source}: no such file")
    if source.is_dir():
        shutil.copytree(source, target, dirs_exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, target)


def make_disk(path, size, *options):
    path.touch()
    os.truncate(path, size)
    subprocess.run(["mkfs.ext4", "-q", "-F", "-E", "root_owner=0:0", *options, path], check=True)


def make_disks(work, things, start):
    """The payload, whose /payload/.board/start is `start`; and a data disk with a journal, as a board has it."""
    tree = work / "payload"
    for inside, path in things.items():
        add(path, tree / inside)
    add(HERE / "guest/limited.sh", tree / ".board/limited.sh")
    (tree / ".board/start").write_text("source /payload/.board/limited.sh\ncd /payload\nSECONDS=0\n"
                                       f"{start}\ncode=$?\necho \"board: took $SECONDS\"\nexit $code\n")
    make_disk(work / "payload.ext4", PAYLOAD_SIZE, "-O", "^has_journal", "-d", tree)
    # All is written now: nothing is left to the board to do in idle moments.
    make_disk(work / "data.ext4", DATA_SIZE, "-E", "lazy_itable_init=0,lazy_journal_init=0")


def run(board, things, start, time_limit, results, hear, cuts=0):
    """Runs the script `start` on a board with the things (name in /payload -> path here). hear(line) is told each line
    of its output. Its exit code, and how long it took by the board's clock [s]. It may ask for so many power cuts.
    Raises BoardError where no exit code comes."""
    disk, state = make(board)
    with tempfile.TemporaryDirectory(dir=board.folder, prefix="run-") as name, locked(name):
        work = pathlib.Path(name)
        make_disks(work, things, start)
        if cuts > 0:
            own = work / "disk.raw"
            subprocess.run(["qemu-img", "convert", "-O", "raw", disk, own], check=True)
            disk = own
        options = machine_options(board, work, disk, cuts == 0)
        code, took, facts = run_once(work, [*options, "-incoming", f"exec:cat {shlex.quote(str(state))}"], hear,
                                     30 + HOST_FACTOR * time_limit)
        for cut in range(1, cuts + 1):
            if code is not None:
                break
            options = machine_options(board, work, disk, False, f"board.cuts={cut} board.facts={facts}")
            code, more, facts = run_once(work, options, hear, BOOT_LIMIT_S + HOST_FACTOR * time_limit, boots=True)
            took += more
        if code is None:
            raise BoardError(f"it asks for a power cut more than the {cuts} that its head tells of")
        if results:
            shutil.rmtree(results, ignore_errors=True)
            pathlib.Path(results).mkdir(parents=True)
            with tarfile.open(work / "files.tar") as archive:
                archive.extractall(results)
    return code, took


def run_once(work, options, hear, limit_s, boots=False):
    """From power on to the end of what it runs, or to the power cut that this asks for. The exit code, None where the
    power was cut; seconds of the board's clock; facts that were told before the cut."""
    last = "nothing"
    took = 0
    with Machine(work, options) as machine:
        begin = f"start {int(time.time())}"
        if not boots:
            machine.say(begin)
        try:
            for line in machine.lines(time.monotonic() + limit_s):
                if cut := CUT.fullmatch(line):
                    return None, int(cut[2]), int(cut[1])
                if line.startswith("board: end "):
                    return int(line.removeprefix("board: end ")), took, 0
                if line.startswith("board: took "):
                    took = int(line.removeprefix("board: took "))
                elif line != "board: ready":
                    last = line
                    hear(line)
                elif boots:
                    machine.say(begin)
        except TimeoutError:
            raise BoardError(f"the board itself hangs: no end after {limit_s} s of the host's clock; it last said: "
                             f"{last}\nits console:\n{machine.console_tail()}") from None
    raise BoardError("the board said nothing of an end")


def command_run(args):
    program = pathlib.Path(args.program)
    things = {program.name: program}
    for path in args.also:
        things[pathlib.Path(path).name] = path
    command = shlex.join([f"./{program.name}", *args.arguments])
    start = f"limited {args.time_limit} {shlex.quote(program.name)} {command}"
    return run(Board(args.board, args.clock), things, start, args.time_limit, args.results, lambda line: print(line, flush=True))[0]


class Case:
    """One script of cases/: what it wants, and what it said."""

    def __init__(self, path, board="debian12"):
        self.path = path
        self.name = f"{path.parent.name}/{path.stem}"
        head = path.read_text()
        self.wants, there, self.brings, boards = (
            [name for line in re.findall(rf"^# {word}: (.*)$", head, re.M) for name in line.split()]
            for word in ("wants", f"wants on {board}", "brings", "boards"))
        self.wants += there
        if unknown := set(boards) - set(BOARDS):
            raise BoardError(f"{path}: no such board: {', '.join(sorted(unknown))}")
        self.boards = boards or list(BOARDS)
        self.limit, self.cuts = (int((re.findall(rf"^# {word}: (\d+)$", head, re.M) or [default])[0])
                                 for word, default in (("limit", 120), ("power cuts", 0)))
        self.only_by_name = "".join(re.findall(r"^# only by name: (.*)$", head, re.M))
        self.facts = []  # (name, "ok" | "not ok" | "skip", text)
        self.comments = []
        self.plan = None
        self.seconds = 0.0  # of the host
        self.board_seconds = 0

    def hear(self, line):
        """A line of TAP; what is none of its kinds is told with the next fact."""
        self.say(f"  {line}")
        if match := re.fullmatch(r"(ok|not ok) \d+ - (.*?)(?: # SKIP ?(.*))?", line):
            kind, name, skipped = match.groups()
            text = "\n".join(self.comments) if skipped is None else f"skipped: {skipped or 'no reason given'}"
            self.facts.append((name, kind if skipped is None else "skip", text))
            self.comments = []
        elif match := re.fullmatch(r"1\.\.(\d+)", line):
            self.plan = int(match[1])
        else:
            self.comments.append(line.removeprefix("# "))

    say = staticmethod(lambda text: print(text, flush=True))

    def fail(self, name):
        self.facts.append((name, "not ok", "\n".join(self.comments)))

    def finish(self, code):
        if code == HUNG:
            self.fail(f"is done within {self.limit} s")
        elif self.plan is None or code:
            self.fail(f"goes through to its end (code {code})")
        elif self.plan != len(self.facts):
            self.fail(f"has {self.plan} facts as it says, not {len(self.facts)}")


def cases_of(names, board="debian12"):
    """Those of the names, all without any, which run on that board."""
    found = [Case(path, board) for path in sorted((HERE / "cases").glob("*/*.sh"))]
    groups = {case.path.parent.name for case in found}
    for name in names:
        if name not in groups and name not in {case.name for case in found}:
            raise UsageError(f"no such group or case: {name}; groups are {', '.join(sorted(groups))}")
    chosen = [case for case in found
              if board in case.boards and (case.name in names or (not case.only_by_name and (
                  not names or case.path.parent.name in names)))]
    if not chosen:
        raise UsageError(f"none of {', '.join(names)} runs on {board}")
    return chosen


def write_junit(cases, path):
    """In the form of ctest's, so that tests/lint/report_tests.py reads it."""
    root = xml.Element("testsuite", name="board")
    for case in cases:
        for name, kind, text in case.facts:
            status = {"ok": "run", "not ok": "fail", "skip": "notrun"}[kind]
            entry = xml.SubElement(root, "testcase", name=f"{case.name}: {name}", classname=case.name, status=status)
            if kind == "not ok":
                xml.SubElement(entry, "failure", message="")
            elif kind == "skip":
                xml.SubElement(entry, "skipped", message="")
            # XML has no control characters.
            xml.SubElement(entry, "system-out").text = re.sub(r"[\x00-\x08\x0b-\x1f]", "?", text)
    pathlib.Path(path).write_bytes(xml.tostring(root))


def wanted(build, want):
    """The file of the build folder that a case calls so."""
    if not want.startswith("packages/"):
        return build / want
    found = sorted(build.glob(f"{want}_*.deb"))
    if len(found) != 1:
        said = ", ".join(path.name for path in found) or "none"
        raise UsageError(f"want one package {build / want}_*.deb, there is: {said}; make it: cmake --build {build} --target packages")
    return found[0]


def target_of(want):
    """The CMake target that makes it."""
    return "packages" if want.startswith("packages/") else pathlib.Path(want).name


def run_case(case, args, results):
    build = pathlib.Path(args.build or PROJECT / "build" / BOARDS[args.board][1])
    things = {"case.sh": case.path, **{f".board/{name}.sh": HERE / f"guest/{name}.sh" for name in ("tap", "daemon", "rig")}}
    for want in case.wants:
        path = wanted(build, want)
        things[path.name] = path
    things.update({f".board/project/{path}": PROJECT / path for path in case.brings})
    start = (f"mkdir -p {shlex.quote(str(PROJECT.parent))}\n"
             f"ln -sfn /payload/.board/project {shlex.quote(str(PROJECT))}\n"
             f"FACTS=$(kernel_word board.facts) limited {case.limit} {case.name} bash case.sh \"$(kernel_word board.cuts)\"")
    begin = time.monotonic()
    try:
        code, case.board_seconds = run(Board(args.board, args.clock), things, start, case.limit, results / case.name,
                                       case.hear, case.cuts)
        case.finish(code)
    except BoardError as error:
        case.comments += str(error).splitlines()
        case.say(f"  {error}")
        case.fail("comes to an end on the board")
    case.seconds = time.monotonic() - begin


def run_side_by_side(cases, jobs, run_one):
    """What a case says is told when it is over, all at once."""
    # A board that still runs ends with us; what it leaves is swept by the next call.
    for ends in (signal.SIGTERM, signal.SIGINT):
        signal.signal(ends, lambda number, _: os._exit(128 + number))
    said = {case.name: [] for case in cases}
    for case in cases:
        case.say = said[case.name].append
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        # Those that may take longest begin.
        running = {pool.submit(run_one, case): case for case in sorted(cases, key=lambda case: -case.limit)}
        for done in concurrent.futures.as_completed(running):
            case = running[done]
            done.result()
            print("\n".join([case.name, *said[case.name]]), flush=True)


def command_test(args):
    cases = cases_of(args.names, args.board)
    results = PROJECT / "build/board-results" / args.board
    shutil.rmtree(results, ignore_errors=True)
    jobs = args.jobs or (1 if args.clock == "real" else min(os.cpu_count() or 1, MOST_JOBS))
    begin = time.monotonic()
    if min(jobs, len(cases)) > 1:
        run_side_by_side(cases, jobs, lambda case: run_case(case, args, results))
    else:
        for case in cases:
            print(f"{case.name}", flush=True)
            run_case(case, args, results)
    write_junit(cases, args.junit)
    for case in cases:
        print(f"{case.name:<24} {case.seconds:6.0f} s, {case.board_seconds:4d} s of the board's clock")
    print(f"{f'all cases, {args.board}':<24} {time.monotonic() - begin:6.0f} s")
    for case in cases:
        for name, kind, _ in case.facts:
            if kind == "not ok":
                print(f"FAILED {case.name}: {name}")
    report = [PROJECT / "tests/lint/report_tests.py", args.junit, PROJECT / "tests/expected_skips.txt"]
    return subprocess.run(report, check=False).returncode


def command_targets(args):
    print(*sorted({target_of(want) for case in cases_of(args.names, args.board) for want in case.wants}))
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    with_board = argparse.ArgumentParser(add_help=False)
    with_board.add_argument("--board", choices=BOARDS, default="debian12")
    with_clock = argparse.ArgumentParser(add_help=False, parents=[with_board])
    with_clock.add_argument("--clock", choices=CLOCKS, default="steady")
    commands.add_parser("make", parents=[with_clock])
    one = commands.add_parser("run", parents=[with_clock])
    one.add_argument("--with", dest="also", action="append", default=[], metavar="PATH")
    one.add_argument("--results", metavar="FOLDER")
    one.add_argument("--time-limit", type=int, default=60, metavar="SECONDS")
    one.add_argument("program")
    one.add_argument("arguments", nargs=argparse.REMAINDER)
    several = argparse.ArgumentParser(add_help=False)
    several.add_argument("names", nargs="*", metavar="GROUP|GROUP/CASE")
    test = commands.add_parser("test", parents=[with_clock, several])
    test.add_argument("--build", metavar="FOLDER")
    test.add_argument("--jobs", type=int, default=0, metavar="N")
    test.add_argument("--junit", default=PROJECT / "build/board.xml", metavar="FILE")
    commands.add_parser("targets", parents=[with_board, several])
    args = parser.parse_args()
    # A finally of ours ends the emulator.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        if args.command == "make":
            make(Board(args.board, args.clock))
            return 0
        return {"run": command_run, "test": command_test, "targets": command_targets}[args.command](args)
    except BoardError as error:
        note(error)
        return 2 if isinstance(error, UsageError) else 1
    except subprocess.CalledProcessError as error:
        note(f"{error.cmd[0]} failed (code {error.returncode})")
        return 1


if __name__ == "__main__":
    sys.exit(main())
