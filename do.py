#!/usr/bin/env python3
"""Glovecal's verbs. Needs Python 3.11 to 3.14 and pip, nothing else (Windows: ``py`` for ``python3``):

    python3 do.py demo      calibrate a simulated glove over real zenoh, in under two minutes
    python3 do.py serve     run the service (real time, REST) on this machine
    python3 do.py glovecal  the command line: python3 do.py glovecal take list
    python3 do.py test      the test suite; with -m slow what it leaves out because it takes minutes
    python3 do.py check     format, lint, types (those also as on Windows and macOS), and known
                            vulnerabilities of the locked packages, where osv.dev is reached
    python3 do.py sbom      what is installed with Glovecal, with hashes, as CycloneDX: dist/sbom.cdx.json
    python3 do.py bench     speed against other libraries, as ratios, with a picture
    python3 do.py paper     Wang & Neff 2013 reproduced: every table and figure, as one page (5 minutes);
                            --part colour-glove: Wang & Popovic 2009's, as far as built (20 minutes)
    python3 do.py docs      the documentation as a site in site/, readable without a network;
                            --compare: run the commands of README and docs/ and hold their outputs against
                            the pages; --write: write the outputs into the pages (half an hour; [PAGE ...])
    python3 do.py study     the blind study of the diagnosis: figures, confusion matrix, a page (hours;
                            --quick, --minutes N; --page docs/study.md writes what was found);
                            study active: active sampling against the fixed protocol (half an hour);
                            study ablation: what every rule of the diagnosis is worth (hours; --minutes N);
                            study new-person: error against seconds of own data, other people as prior
                            (needs the shared recordings; a few minutes);
                            study offline: recordings estimated with both directions of time, against live
                            (half an hour);
                            study planted: faults planted into 20 s of real readings, and what is told of them
                            (needs the shared recordings; ten minutes; --healthy N: simulated gloves);
                            study told: what doctor, live watch, training and pages tell of healthy gloves
                            (ten minutes; --gloves N, --method lmc_gpr);
                            study demos: is anything told in fifty demos that is not so? (half an hour);
                            study camera: a camera as the reference against true angles
                            (a quarter of an hour);
                            study camera-errors: what the colour glove's tracker errs by (an hour;
                            --sizes: the same scene at 640 to 3840 pixels);
                            study camera-applications: the examples driven by a camera's poses;
                            study faults: kills, cuts, full disks at random: is anything lost? (two minutes;
                            --faults N, --seed S, --minutes N; --table lists what is tried)
    python3 do.py fresh     demo and test on bare Debian systems, as a table (hours; needs root, debootstrap;
                            fresh trixie -- tests/client: these tests only)
    python3 do.py containers  both container images built, run, killed and upgraded (needs podman;
                            --debootstrap where no image registry is reached; half an hour)
    python3 do.py blender   the Blender extension as a zip in dist/; --platform all: for every system;
                            --test: exports and live hands in Blender's own module, as a table (3 minutes)
    python3 do.py picture   pictures of the studio for README and docs/, from running pages (needs Chromium)

uv is installed into .tools and the locked packages into .venv; nothing outside this folder is touched
but the caches of pip and uv. Where only another Python is found, uv brings one into .tools.
Any verb with --smoke tries itself in seconds, with what is installed: nothing is fetched.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent
TOOLS = ROOT / ".tools"
SMOKE = "--smoke"
SIMULATED = ("tests/simulated",)
BLENDER = ("client/blender", "tests/service/exports")
STUDIO = ("tests/service/studio", "tests/service", *SIMULATED)
BRIDGES = ("tests/service/bridges", "tests/service/cli", "tests/service", *SIMULATED)
SMOKE_TESTS = ("tests/models/test_layout.py", "tests/architecture/test_surroundings.py")
PUBLIC = ("glovecal", "glovecal_client")
PYTEST = ("python", "-I", "-m", "pytest")  # -I: packages of the user's PYTHONPATH are not those of the lock
BROUGHT = "3.13"
"""The Python that uv brings where there is none of these."""
OWN_PYTHON = {
    "UV_PYTHON_PREFERENCE": "system",
    "UV_PYTHON_DOWNLOADS": "manual",
    "UV_PYTHON_INSTALL_DIR": str(TOOLS / "python"),
}
PRODUCT = ("models", "client", "service")
STOPPING = ("SIGTERM", "SIGHUP", "SIGINT")
"""Windows has not all of them."""
OTHER_SYSTEMS = ("Windows", "Darwin")
NOT_THE_SAME = """
    asyncio concurrent ctypes errno faulthandler fcntl locale mmap msvcrt multiprocessing os pathlib pty
    resource select selectors shutil signal socket socketserver ssl stat subprocess sys tempfile termios time
    tty webbrowser winreg
"""
"""Modules whose types depend on the system (``sys.platform`` in typeshed)."""
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


OTHER_PYTHON = f"Glovecal needs Python 3.11 to 3.14; here is {sys.version.split()[0]}"


class Unavailable(Exception):
    """Nothing can be run on this computer as it is; the sentence says what to install."""


def uv() -> list[str]:
    """The uv command, installed into .tools when it is not there yet. Raises Unavailable."""
    if not (TOOLS / "uv").is_dir():
        print("installing uv into .tools ...", file=sys.stderr)
        if sys.version_info < (3, 8):  # there is no uv for it
            raise Unavailable(f"{OTHER_PYTHON}: install one of them and try again")
        pip = [sys.executable, "-m", "pip"]
        if subprocess.run([*pip, "--version"], cwd=ROOT, stdout=subprocess.DEVNULL).returncode:
            raise Unavailable(
                f"{sys.executable} has no pip: install it (Debian, Ubuntu: apt install python3-pip)"
            )
        install = [*pip, "install", "--quiet", "--disable-pip-version-check", "--target", str(TOOLS), "uv"]
        if subprocess.run(install, cwd=ROOT).returncode:
            raise Unavailable(
                "pip could not install uv into .tools, for the reason above: does pip reach its index?"
            )
    return [shutil.which("uv", path=str(TOOLS / "bin")) or "uv"]  # uv.exe on Windows


def find_python(environment: dict[str, str]) -> None:
    """One that pyproject.toml allows; uv brings one where this computer has none. Raises Unavailable."""
    silent = {"cwd": ROOT, "env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    if (ROOT / ".venv").is_dir() or subprocess.run([*uv(), "python", "find"], **silent).returncode == 0:
        return
    print(f"no Python 3.11 to 3.14 is here: bringing {BROUGHT} into .tools ...", file=sys.stderr)
    if subprocess.run([*uv(), "python", "install", "--no-bin", BROUGHT], **silent).returncode:
        raise Unavailable(f"{OTHER_PYTHON}, and uv could not bring one: install one of them and try again")


def run(*command: str, groups: tuple[str, ...] = (), dev: bool = False, beside: tuple[str, ...] = ()) -> int:
    """Run a command in the locked environment; with --smoke in the one that is there, as it is.

    ``beside``: folders whose modules a script may import beside its own. Raises Unavailable.
    """
    options = ["run", "--frozen", "--all-packages", "--all-extras", "--no-default-groups"]
    for group in (*groups, *(("dev",) if dev else ())):
        options += ["--group", group]
    if SMOKE in sys.argv:
        if not (TOOLS / "uv").is_dir() or not (ROOT / ".venv").is_dir():
            raise Unavailable("--smoke installs nothing, and .venv is not there yet: python3 do.py test")
        options = ["run", "--no-sync", "--offline"]
    quiet = ["--quiet"] if (ROOT / ".venv").is_dir() else []
    environment = {**os.environ, **ONE_THREAD, **OWN_PYTHON}
    if beside:
        environment["PYTHONPATH"] = os.pathsep.join(str(ROOT / folder) for folder in beside)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # every process would compile all packages anew
    if not os.access(Path.home(), os.W_OK):
        environment.setdefault("UV_CACHE_DIR", str(TOOLS / "cache"))
    find_python(environment)
    return exit_code_of([*uv(), *quiet, *options, *command], environment)


def exit_code_of(command: list[str], environment: dict[str, str] | None = None) -> int:
    """Of a process that is asked to stop when this one is, so that it leaves nothing running."""
    process = subprocess.Popen(command, cwd=ROOT, env=environment)

    def pass_on(number: int, _frame: object) -> None:
        if number != signal.SIGINT or not is_at_terminal():  # whose Ctrl-C reaches both
            process.send_signal(number)

    for name in STOPPING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, pass_on)
    return process.wait()


def is_at_terminal() -> bool:
    """Whether keys typed at a terminal reach this process and those that it started."""
    try:
        with open("/dev/tty", "rb") as terminal:
            return os.tcgetpgrp(terminal.fileno()) == os.getpgrp()
    except (OSError, AttributeError):
        return sys.platform == "win32"


def demo(arguments: list[str]) -> int:
    return run("glovecal", "demo", *arguments)


def serve(arguments: list[str]) -> int:
    return run("glovecal", "serve", *arguments)


def glovecal(arguments: list[str]) -> int:
    if SMOKE in arguments:
        return run("glovecal", "effects")
    return run("glovecal", *arguments)


def test(arguments: list[str]) -> int:
    """Three files at a time: many tests wait for a glove, a cable or a process. Slow ones: -m slow."""
    if SMOKE in arguments:
        return run(*PYTEST, "-q", *SMOKE_TESTS, dev=True)
    three = ("-n", "3", "--dist", "loadfile", "--no-loadscope-reorder")
    return run(*PYTEST, *three, *arguments, dev=True)


def check(arguments: list[str]) -> int:
    where = "do.py" if SMOKE in arguments else "."
    ruff = (["ruff", "format", "--no-cache", "--check", where], ["ruff", "check", "--no-cache", where])
    if SMOKE in arguments:
        return max(run(*step, dev=True) for step in (*ruff, ["pyright", "do.py"]))
    # a text file's encoding is said: on Windows the usual one is not UTF-8
    encoding = ["ruff", "check", "--no-cache", "--preview", "--select", "PLW1514", *PRODUCT]
    elsewhere = [
        ["pyright", "--threads", "2", "--pythonplatform", name, *near_the_system()] for name in OTHER_SYSTEMS
    ]
    public = [["pyright", "--ignoreexternal", "--verifytypes", name] for name in PUBLIC]
    steps = (*ruff, encoding, ["pyright", "--threads", "2", *arguments], *elsewhere, *public)
    return max(*[run(*step, dev=True) for step in steps], known_vulnerabilities())


def known_vulnerabilities() -> int:
    """Of the locked packages that Glovecal is installed with, by osv.dev; 0 where it is not reached."""
    audit = [*uv(), "audit", "--frozen", "--no-dev", "--preview-features", "audit-command"]
    found = subprocess.run(audit, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    if found.returncode not in (0, 1):
        print("Known vulnerabilities were not looked up: osv.dev is not reached.", file=sys.stderr)
        return 0
    print(found.stdout)
    return found.returncode


def sbom(arguments: list[str]) -> int:
    """uv calls this form experimental. Container images have one of their own: docker/."""
    with tempfile.TemporaryDirectory() as temporary:
        file = Path(temporary if SMOKE in arguments else ROOT / "dist", "sbom.cdx.json")
        file.parent.mkdir(exist_ok=True)
        form = ("--format", "cyclonedx1.5", "--preview-features", "sbom-export", "--output-file", str(file))
        code = exit_code_of(
            [*uv(), "--quiet", "export", "--frozen", "--all-packages", "--all-extras", "--no-dev", *form]
        )
        if code == 0:
            count = len(json.loads(file.read_text(encoding="utf-8"))["components"])
            print(f"{count} packages: {file}")
    return code


def near_the_system() -> list[str]:
    """Files of the product that import a module of Python which is not the same everywhere."""
    modules = "|".join(NOT_THE_SAME.split())
    imports = re.compile(rf"^\s*(import|from) ({modules})\b", re.MULTILINE)
    found = (file for part in PRODUCT for file in sorted((ROOT / part).rglob("*.py")))
    return [str(file) for file in found if imports.search(file.read_text(encoding="utf-8"))]


def bench(arguments: list[str]) -> int:
    if arguments[:1] in (["streaming"], ["improvement"]):  # they need none of the peers
        return run("python", "tests/bench/bench.py", *arguments)
    if arguments[:1] in (["studio"], ["lists"], ["capacity"]):
        return run("python", "tests/bench/bench.py", *arguments, dev=True, beside=STUDIO)
    if arguments[:1] == ["bridges"]:
        return run("python", "tests/bench/bench.py", *arguments, dev=True, beside=BRIDGES)
    if SMOKE not in arguments:
        install_gpytorch()
    return run("python", "tests/bench/bench.py", *arguments, groups=("bench",), dev=True, beside=STUDIO)


def paper(arguments: list[str]) -> int:
    return run("python", "tests/paper/paper.py", *arguments, beside=SIMULATED)


def study(arguments: list[str]) -> int:
    if arguments[:1] == ["active"]:
        return run("python", "tests/study/active_sampling.py", *arguments[1:], beside=SIMULATED)
    if arguments[:1] == ["new-person"]:
        return run("python", "tests/study/new_person.py", *arguments[1:])
    if arguments[:1] == ["offline"]:
        return run("python", "tests/study/offline_study.py", *arguments[1:])
    if arguments[:1] == ["planted"]:
        return run("python", "tests/study/planted_study.py", *arguments[1:])
    if arguments[:1] == ["told"]:
        return run("python", "tests/study/told_study.py", *arguments[1:])
    if arguments[:1] == ["ablation"]:
        return run("python", "tests/study/ablation.py", *arguments[1:])
    if arguments[:1] == ["demos"]:
        return run("python", "tests/study/demo_table.py", *arguments[1:])
    if arguments[:1] == ["camera-errors"]:
        return run("python", "tests/study/tracked_errors.py", *arguments[1:], beside=SIMULATED)
    if arguments[:1] == ["camera-applications"]:
        beside = (*SIMULATED, "client/examples")
        return run("python", "tests/study/camera_applications.py", *arguments[1:], dev=True, beside=beside)
    if arguments[:1] == ["faults"]:
        return run("python", "tests/study/fault_study.py", *arguments[1:], dev=True, beside=SIMULATED)
    if arguments[:1] == ["camera"]:
        return run("python", "tests/study/camera_study.py", *arguments[1:], beside=SIMULATED)
    return run("python", "tests/study/study.py", *arguments)


def picture(arguments: list[str]) -> int:
    return run("python", "tests/bench/studio_picture.py", *arguments, dev=True, beside=STUDIO)


def fresh(arguments: list[str]) -> int:
    """Needs no locked package: nothing is installed for it."""
    return exit_code_of([sys.executable, "tests/fresh/fresh.py", *arguments])


def containers(arguments: list[str]) -> int:
    return run("python", "tests/containers/containers.py", *arguments, dev=True, beside=("tests/fresh",))


def blender(arguments: list[str]) -> int:
    """Wheels for other systems are fetched by this Python's pip."""
    if SMOKE in arguments:
        return run("python", "client/blender/build_extension.py", "--help")
    if "--test" in arguments:
        rest = [each for each in arguments if each != "--test"]
        script = ("tests/blender/try_blender.py", "--uv", uv()[0], "--pip", sys.executable, *rest)
        return run("python", *script, dev=True, beside=BLENDER)
    return run("python", "client/blender/build_extension.py", "--pip", sys.executable, *arguments, dev=True)


def docs(arguments: list[str]) -> int:
    """A warning is an error: a link that leads nowhere must not get into the site. docs FOLDER: elsewhere."""
    if {"--compare", "--write"} & set(arguments):
        return run("python", "-m", "transcripts", *arguments, groups=("docs",), beside=("docs",))
    with tempfile.TemporaryDirectory() as temporary:
        usual = Path(temporary, "site") if SMOKE in arguments else ROOT / "site"
        site = next((Path(folder).resolve() for folder in arguments if folder != SMOKE), usual)
        strict = ("--fail-on-warning", "--fresh-env", "--quiet", "--doctree-dir", f"{temporary}/doctrees")
        if SMOKE not in arguments:
            run("python", "docs/thresholds_page.py", groups=("docs",))
            run("python", "docs/glossary_words.py", groups=("docs",))
        code = run("sphinx-build", *strict, "--conf-dir", "docs", ".", str(site), groups=("docs",))
        pages = sum(1 for _ in site.rglob("*.html"))
    if code == 0:
        print(f"{pages} pages built." if SMOKE in arguments else f"{pages} pages: {site / 'index.html'}")
    return code


def install_gpytorch() -> None:
    """GPyTorch stays out of the lock file: on Linux its torch brings gigabytes of GPU libraries.

    pip puts both into a folder of their own, where pip may be told to find a smaller build of torch.
    """
    folder = TOOLS / "gpytorch"
    if folder.is_dir():
        return
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    if subprocess.run(
        [*pip, "--target", str(folder), "torch==2.13.0", "gpytorch==1.15.2"], cwd=ROOT
    ).returncode:
        print("GPyTorch could not be installed: the bench goes on without it", file=sys.stderr)


VERBS = {
    "demo": demo,
    "serve": serve,
    "glovecal": glovecal,
    "test": test,
    "check": check,
    "sbom": sbom,
    "bench": bench,
    "paper": paper,
    "study": study,
    "fresh": fresh,
    "containers": containers,
    "blender": blender,
    "picture": picture,
    "docs": docs,
}


def main(arguments: list[str]) -> int:
    if not arguments or arguments[0] not in VERBS:
        print(__doc__)
        return 0 if not arguments or arguments[0] in ("help", "-h", "--help") else 2
    try:
        return VERBS[arguments[0]](arguments[1:])
    except Unavailable as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
