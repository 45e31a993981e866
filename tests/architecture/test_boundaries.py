"""The arrows of design.md: service -> models, service -> client; models and client know neither each other
nor the service. Checked on the source, and by importing each distribution with the others forbidden."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = {
    "models": ROOT / "models" / "glovecal_models",
    "client": ROOT / "client" / "glovecal_client",
    "service": ROOT / "service" / "glovecal_service",
}
FORBIDDEN = {
    "models": {
        "glovecal_client", "glovecal_service", "zenoh", "fastapi", "starlette", "uvicorn", "httpx",
        "requests", "socket", "http", "urllib", "serial", "sqlalchemy", "distributed", "pydantic",
    },
    "client": {
        "glovecal_models", "glovecal_service", "scipy", "fastapi", "starlette", "uvicorn", "pydantic",
        "sqlalchemy", "distributed", "safetensors",
    },
    "service": set(),
}  # fmt: skip
PICKLES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
PICKLES_FOR_ITS_WORKERS = SOURCES["models"] / "worker_processes.py"
POOLS = ("ProcessPoolExecutor", "multiprocessing.pool", ".Pool(")
"""They hang at Ctrl-C, and pickle without a word."""


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def imports(path: Path) -> set[str]:
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("distribution", SOURCES)
def test_no_forbidden_import(distribution):
    for path in sorted(SOURCES[distribution].rglob("*.py")):
        pickles = {"pickle"} if path == PICKLES_FOR_ITS_WORKERS else set()
        wrong = imports(path) & (FORBIDDEN[distribution] | PICKLES) - pickles
        assert not wrong, f"{path.relative_to(ROOT)} imports {sorted(wrong)}"


def test_there_is_one_pool_of_processes():
    for path in sorted([*ROOT.glob("*/glovecal*/**/*.py"), *ROOT.glob("tests/*/*.py")]):
        assert path == Path(__file__) or not any(
            pool in path.read_text(encoding="utf-8") for pool in POOLS
        ), path


def is_of_answers(module: str) -> bool:
    """Types of answers and how they are shown, and no mathematics."""
    name = module.split(".")
    return name[:2] == ["glovecal_models", "presentation"] or (
        name[0] in ("glovecal_models", "glovecal_service") and name[-1] == "answer"
    )


def test_a_page_of_the_studio_computes_nothing_that_rest_cannot_give():
    """It asks REST's own routes in its process, and has neither the mathematics nor the store: of the models
    and of REST only the types of answers."""
    allowed = (
        "glovecal_service.plain",
        "glovecal_service.studio",
        "glovecal_service.settings",
        "glovecal_service.rest.http.observation",
        "glovecal_models.presentation",
    )
    for path in sorted((SOURCES["service"] / "studio").rglob("*.py")):
        for node in nodes(path):
            names = [node.module] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            ours = [
                name for name in names if name and name.startswith(("glovecal_models", "glovecal_service"))
            ]
            wrong = [name for name in ours if not name.startswith(allowed) and not is_of_answers(name)]
            assert not wrong, f"{path.relative_to(ROOT)} imports {wrong}"


def test_what_rest_answers_is_types_and_no_work():
    """The command line and the studio read them, and load nothing for it but what checks them."""
    work = {"fastapi", "starlette", "numpy", "zenoh", "sqlalchemy", "nicegui", "scipy"}
    for path in sorted((SOURCES["service"] / "rest").rglob("answer.py")):
        assert not imports(path) & work, path
        body = ast.parse(path.read_text(encoding="utf-8")).body
        functions = [node.name for node in body if isinstance(node, ast.FunctionDef)]
        assert not functions, f"{path.relative_to(ROOT)} does something: {functions}"


def test_a_page_of_the_studio_has_time_on_a_busy_computer():
    """The library gives a page three seconds, then tells the user about its own programming interface."""
    studio = SOURCES["service"] / "studio"
    for path in sorted(studio.rglob("*.py")):
        assert path == studio / "shell.py" or "ui.page(" not in path.read_text(encoding="utf-8"), path


@pytest.mark.parametrize("distribution", ["models", "client"])
def test_every_module_imports_without_what_it_must_not_need(distribution):
    """Optional extras (pyarrow, pyserial, httpx) must not be needed just to import a module."""
    package = SOURCES[distribution]
    names = [
        ".".join(path.relative_to(package.parent).with_suffix("").parts)
        for path in sorted(package.rglob("*.py"))
        if path.name not in ("__init__.py", "env.py") and "migrations" not in path.parts
    ]
    blocked = sorted(
        (FORBIDDEN[distribution] - {"socket", "http", "urllib"}) | {"pyarrow", "serial", "httpx"}
    )
    program = f"""
import importlib, sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {blocked!r}:
            raise ImportError("blocked: " + name)
sys.meta_path.insert(0, Block())
for name in {names!r}:
    importlib.import_module(name)
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr


def test_eval_and_exec_are_not_used():
    for package in SOURCES.values():
        for path in package.rglob("*.py"):
            calls = [
                node.func.id
                for node in nodes(path)
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
            ]
            assert not {"eval", "exec", "compile"} & set(calls), path


def test_nothing_is_known_by_what_stands_around_it() -> None:
    """What a function needs is given to it: no registry in a context variable."""
    for folder in SOURCES.values():
        for path in sorted(folder.rglob("*.py")):
            assert "contextvars" not in path.read_text(encoding="utf-8"), path


APART = (
    ("realtime", "recorder"),
    ("recorder", "realtime"),
    ("incoming", "realtime"),
    ("incoming", "recorder"),
)


@pytest.mark.parametrize(("folder", "other"), APART)
def test_the_folder_of_a_process_imports_no_other_process(folder: str, other: str) -> None:
    """Real time and the recorder share what lets frames in, and nothing else of each other."""
    for path in sorted((SOURCES["service"] / folder).rglob("*.py")):
        assert f"glovecal_service.{other}" not in path.read_text(encoding="utf-8"), path
