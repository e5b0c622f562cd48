"""The house stands: imports go down only, modules stand alone, commands are documented, the docs are true."""

from __future__ import annotations

import ast
import contextlib
import graphlib
import importlib
import io
import pkgutil
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

ROOT = Path(__file__).parents[1]
PACKAGE, CLIENT = ROOT / "vid2ev", ROOT / "interp"
README = (ROOT / "README.md").read_text(encoding="utf-8")

# The floor of each room; an import may only go to a lower floor, or stay in its own room.
FLOORS = {
    "errors": 0,
    "cores": 0,
    "toml_text": 0,
    "stamps": 0,
    "interrupts": 0,
    "terminal": 1,
    "cluster": 1,
    "requests": 1,
    "untrusted": 1,
    "compiling": 0,
    "bounds": 1,
    "stream": 1,
    "pictures": 1,
    "light": 2,
    "rig": 4,
    "scenes": 5,
    "sources": 6,
    "upsample": 6,
    "physics": 2,
    "formats": 2,
    "recording": 3,
    "views": 4,
    "kernels": 4,
    "sensors": 7,
    "compare": 8,
    "seen": 8,
    "tracks": 9,
    "reformat": 9,
    "plan": 10,
    "making": 11,
    "cost": 11,
    "": 12,  # vid2ev/__init__.py: the public names
    "gui": 13,
    "commands": 14,
    "__main__": 15,
}
# Those of interp, which stands beside vid2ev and uses it, never the other way round.
CLIENT_FLOORS = {
    "": 0,
    "precision": 0,
    "pretrained": 0,
    "around": 0,
    "rows": 0,
    "light": 1,
    "own_codes": 2,
    "warp": 1,
    "blend": 1,
    "blocks": 1,
    "representation": 2,
    "candidates": 3,
    "networks": 4,
    "losses": 5,
    "weights": 5,
    "work": 5,
    "data": 5,
    "methods": 6,
    "evaluate": 7,
    "upsampler": 7,
    "interpolate": 7,
    "train": 7,
    "cost": 8,
    "reconstruct": 8,
    "commands": 9,
}
PACKAGES = {"vid2ev": FLOORS, "interp": CLIENT_FLOORS}


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for package in (PACKAGE, CLIENT) for path in sorted(package.rglob("*.py"))}
COMMANDS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["vid2ev.commands"]


def package(module: str) -> str:
    return module.split(".")[0]


def room(module: str) -> str:
    return [*module.split("."), ""][1]


def imports_of(nodes: list[ast.stmt]) -> set[str]:
    """Our modules that the statements import; `from package import name` is resolved to a module."""
    found: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                found.add(submodule if submodule in MODULES else node.module or "")
    return {name for name in found if package(name) in PACKAGES}


def tree(module: str) -> ast.Module:
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_down_only(module: str) -> None:
    # Imports inside functions count too: they are later, not higher.
    nodes = [node for node in ast.walk(tree(module)) if isinstance(node, ast.stmt)]
    floors = PACKAGES[package(module)]
    assert room(module) in floors, f"give the room of {module} a floor"
    for target in imports_of(nodes):
        if package(target) != package(module):
            assert package(module) == "interp", f"{module} -> {target}: vid2ev knows nothing of its clients"
            continue
        assert room(target) == room(module) or floors[room(target)] < floors[room(module)], f"{module} -> {target}"


@pytest.mark.parametrize("module", [module for module in MODULES if package(module) == "interp"])
def test_a_client_uses_public_names_only(module: str) -> None:
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom) and package(node.module or "") == "vid2ev":
            parts = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
            assert not any(part.startswith("_") for part in parts), f"{module} imports {'.'.join(parts)}"


@pytest.mark.parametrize("module", [module for module in MODULES if package(module) == "interp"])
def test_only_commands_import_the_floor_of_commands(module: str) -> None:
    """A library knows nothing of who calls it, whichever package it is of."""
    nodes = [node for node in ast.walk(tree(module)) if isinstance(node, ast.stmt)]
    above = {target for target in imports_of(nodes) if target.startswith(("vid2ev.commands", "vid2ev.gui"))}
    assert not above or room(module) == "commands", f"{module} imports {', '.join(sorted(above))}"


def test_imports_make_no_cycle() -> None:
    graph = {module: imports_of(tree(module).body) - {module} for module in MODULES}
    graphlib.TopologicalSorter(graph).prepare()


ALL_TOGETHER = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
"""
EACH_ALONE = """
import importlib, sys
for name in sys.argv[1:]:
    for loaded in [loaded for loaded in sys.modules if loaded.split(".")[0] in ("vid2ev", "interp")]:
        del sys.modules[loaded]
    importlib.import_module(name)
"""


@pytest.mark.timeout(1200)
@pytest.mark.parametrize(
    "program", [ALL_TOGETHER, pytest.param(EACH_ALONE, marks=pytest.mark.slow)], ids=["together", "alone"]
)
def test_every_module_imports(program: str) -> None:
    """From the last to the first, so that what is low is not there already when what is high asks for it."""
    names = sorted((name for name in MODULES if not name.endswith("__main__")), reverse=True)
    done = subprocess.run([sys.executable, "-c", program, *names], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("arguments", [["-c", "import vid2ev"], ["-m", "vid2ev", "--help"]])
def test_a_quick_start_loads_nothing_heavy(arguments: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-X", "importtime", *arguments], capture_output=True, text=True, cwd=ROOT, check=True
    )
    loaded = {line.rpartition("|")[2].strip().split(".")[0] for line in done.stderr.splitlines()}
    assert "vid2ev" in loaded
    assert not loaded & {"numpy", "numba", "av", "cv2", "h5py", "pydantic"}


@pytest.mark.parametrize("module", MODULES)
def test_modules_are_short(module: str) -> None:
    assert len(MODULES[module].read_text(encoding="utf-8").splitlines()) <= 400


def test_every_public_name_is_there() -> None:
    import vid2ev

    assert all(getattr(vid2ev, name) is not None for name in vid2ev.__all__)
    assert set(vid2ev.__all__) <= set(dir(vid2ev)) and len(set(dir(vid2ev))) == len(dir(vid2ev))


def effects() -> dict[str, type]:
    """The parameter models in physics/, one per effect."""
    from pydantic import BaseModel

    models: dict[str, type] = {}
    for name in MODULES:
        if name.startswith("vid2ev.physics."):
            module = importlib.import_module(name)
            for value in vars(module).values():
                if isinstance(value, type) and issubclass(value, BaseModel) and value.__module__ == name:
                    models[name] = value
    return models


def test_every_effect_says_what_it_is_in_units_and_where_it_comes_from() -> None:
    units = {"us": "[us]", "hz": "[Hz]"}
    assert effects()
    for name, model in effects().items():
        page = importlib.import_module(name).__doc__ or ""
        assert re.search(r"^Sources?:", page, re.MULTILINE), f"{name} cites no source"
        assert re.search(r"^    \S", page, re.MULTILINE), f"{name} displays no law"
        for key, field in model.model_fields.items():  # type: ignore[attr-defined]
            assert field.description, f"{name}: {key} has no description"
            suffix = key.rpartition("_")[2]
            if suffix in units and key != "frame_rate_hz":
                assert units[suffix] in field.description, f"{name}: {key} does not say {units[suffix]}"


def test_every_effect_is_of_a_sensor_whose_plans_can_leave_it_out() -> None:
    """But for the thresholds and the log, without which there are no events."""
    from vid2ev.physics.comparator import Comparator
    from vid2ev.physics.log_curve import LogCurve
    from vid2ev.plan.frame_camera import FRAME_EFFECTS
    from vid2ev.plan.plan import EFFECTS
    from vid2ev.sensors.cis_spec import CisSpec
    from vid2ev.sensors.spec import DvsSpec

    for name, model in effects().items():
        known = [plans for spec, plans in ((DvsSpec, EFFECTS), (CisSpec, FRAME_EFFECTS)) if issubclass(spec, model)]
        assert known, f"{name}: {model.__name__} is no base of a sensor's specification"
        for plans in known:
            off = {key for effect in plans.values() for key in effect.off}
            assert model in (Comparator, LogCurve) or off & {*model.model_fields}, (
                f"no line of the plans has {name} off"
            )


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_stands_in_the_readme(name: str) -> None:
    module, _, attribute = COMMANDS[name].partition(":")
    command = getattr(importlib.import_module(module), attribute)
    shown = CliRunner().invoke(command, ["--help"], prog_name=f"vid2ev {name}")
    assert shown.exit_code == 0, shown.output
    assert command.help and command.name == name
    assert all(option.help for option in command.params if isinstance(option, click.Option))
    assert f"vid2ev {name}" in README


@pytest.mark.parametrize("folder", [ROOT, CLIENT])
def test_the_readme_is_true(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each Python block runs, all in one namespace, and prints what the text block after it shows."""
    monkeypatch.chdir(ROOT)
    page = (folder / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```(?:\s*```text\n(.*?)```)?", page, re.DOTALL)
    assert blocks
    namespace: dict[str, object] = {}
    for code, expected in blocks:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, str(folder / "README.md"), "exec"), namespace)
        assert printed.getvalue().strip() == expected.strip()


def test_the_readme_says_of_every_event_file_what_the_register_does() -> None:
    from vid2ev.formats import FORMATS, format_named

    table = README.partition("| `--format` ")[2].partition("\n\n")[0]
    said: dict[str, tuple[str, set[str], str]] = {}
    for row in table.splitlines()[2:]:
        names, suffixes, _, holds, read = (cell.strip() for cell in row.split("|")[1:-1])
        named, ends = (re.findall(r"`([^`]+)`", cell) for cell in (names, suffixes))
        for name, end in zip(named, ends if len(ends) == len(named) else len(named) * (ends or [""]), strict=True):
            held = {what.removesuffix(f" ({name})") for what in holds.split(", ") if holds}
            said[name] = end, {what for what in held if "(" not in what}, read
    words, registered = {"frame times": "index per frame"}, dict[str, tuple[str, set[str], str]]()
    for kind in map(format_named, FORMATS):
        held = {words.get(each, each) for each in kind.keeps}
        registered[kind.name] = (kind.suffix, held, "yes") if kind.write else ("", set(), "only")
    assert said == registered


def test_the_readme_names_every_preset() -> None:
    from vid2ev.sensors.presets import preset_names

    assert all(f"`{name}`" in README for name in preset_names())


DOCUMENTS = [
    ROOT / "README.md",
    *sorted(page for folder in ("docs", "vid2ev", "interp") for page in (ROOT / folder).rglob("*.md")),
]


def test_links_in_the_documents_lead_somewhere() -> None:
    for page in DOCUMENTS:
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            if not target.startswith("http"):
                assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_names_in_the_documents_are_there(page: Path) -> None:
    for name in re.findall(r"`((?:vid2ev|interp)(?:\.[A-Za-z_]\w*)+)", page.read_text(encoding="utf-8")):
        pkgutil.resolve_name(name)  # (raises if it is not)


@pytest.mark.parametrize(("package", "least"), [(PACKAGE, 30), (CLIENT, 15)])
def test_every_hard_case_names_tests_that_are_there(package: Path, least: int) -> None:
    page = (package / "HARD_CASES.md").read_text(encoding="utf-8")
    there = {
        node.name
        for path in (ROOT / "tests").rglob("test_*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
    }
    rows = [line for line in page.splitlines() if line.startswith("|") and not line.startswith(("| hard case", "|--"))]
    for row in rows:
        named = set(re.findall(r"`(test_\w+)`", row.rstrip("|").rpartition("|")[2]))
        assert named and named <= there, f"{row}: no test {', '.join(named - there)}"
    assert len(rows) > least
